"""The paper's claims about its law, held against the numbers of a comparison.

    claim                                            where        measured
    errors converge to a small neighbourhood of 0    section 4    all settle, of the paper's law
    unknown parameters are handled                   abstract     final position error against the
                                                                  same surfaces with a wrong Θ
    simpler than backstepping                        Remark 3.3   processor time of a step
    no numerical derivatives of virtual controls     section 1    torque against a law that has
                                                                  them
    larger k, smaller γ: smaller error               Remark 3.4   final position error of the same
    smaller K_5: smaller error                       Remark 3.4   law under other gains

A relation holds if it does by more than `MARGIN`. A claim whose laws aren't there is not testable,
nor is one about the coordination, which is the same under every law. The verdict is that of these
runs, this path and these gains: it proves no theorem and refutes none.
"""

from collections.abc import Iterator, Sequence
from enum import Enum
from math import isfinite
from typing import Any, NamedTuple

from fleetloop.compare.measures import SPREAD
from fleetloop.compare.results import Row
from fleetloop.settling import SETTLE_BAND

PAPER_LAW, FIXED_LAW = "adaptive_dsc", "fixed_dsc"
ANALYTIC_LAW, NUMERIC_LAW = "backstepping_analytic", "backstepping_numeric"
MARGIN = 1.05
"""Two numbers that are closer than this factor are alike."""
WRONG_THETA = 0.05
"""A Θ that is off by more than this share is wrong."""
_ERRORS = (
    ("x_e_m", "x_e", "mm"),
    ("y_e_m", "y_e", "mm"),
    ("theta_e_rad", "θ_e", "mrad"),
    (SPREAD, "spread", "mm"),
)
_UP, _DOWN = ("k1", "k2", "k3", "k4"), ("gamma_1_s", "gamma_2_s", "gamma_3_s")


class Verdict(Enum):
    """Of a claim."""

    HOLDS = "holds"
    DOES_NOT_HOLD = "does not hold"
    NOT_TESTABLE = "not testable here"


class Claim(NamedTuple):
    """A claim, its place in the paper, what was measured, and the verdict."""

    claim: str
    where: str
    measured: str
    verdict: Verdict


def claims(rows: Sequence[Row]) -> list[Claim]:
    """Every claim, those that can't be tested last; one that several rows test, once for each."""
    ours = [row for row in rows if row.law == PAPER_LAW]
    first = ours[0] if ours else None
    found = [
        *_convergence(first),
        *_adaptation(first, [row for row in rows if row.law == FIXED_LAW]),
        *_simplicity(rows, first),
        *_derivatives(rows, first),
        *_gains(first, ours[1:]),
        Claim(
            "the distributed speed estimator reduces communication",
            "section 1, (38)",
            "the coordination is the same under every law; compare scenarios with other"
            " graph.leader",
            Verdict.NOT_TESTABLE,
        ),
    ]
    return sorted(found, key=lambda one: one.verdict is Verdict.NOT_TESTABLE)


def _judged(claim: str, where: str, measured: str, *, holds: bool) -> Claim:
    return Claim(claim, where, measured, Verdict.HOLDS if holds else Verdict.DOES_NOT_HOLD)


def _missing(claim: str, where: str, law: str) -> Claim:
    return Claim(claim, where, f"needs {law} among the laws", Verdict.NOT_TESTABLE)


def _convergence(ours: Row | None) -> Iterator[Claim]:
    claim, where = "all errors converge to a small neighbourhood of the origin", "section 4"
    if ours is None:
        yield _missing(claim, where, PAPER_LAW)
        return
    if ours.worst is None or not ours.sound:
        yield _judged(claim, where, "; ".join(ours.troubles) or "no run", holds=False)
        return
    settled, final = ours.worst["settle_s"], ours.worst["final_max"]
    known = [error for error in _ERRORS if final[error[0]] is not None]
    open_ = [symbol for name, symbol, _ in known if settled[name] is None]
    if open_:
        after_s = ours.scenario.ends_at_s
        said = f"{' and '.join(open_)} not within ±{SETTLE_BAND:g} after {after_s:g} s"
    else:
        latest = max(settled[name] for name, _, _ in known)
        said = f"all within ±{SETTLE_BAND:g} from {latest:.1f} s on"
    sizes = [f"{symbol} {_number(final[name], 1e3)} {unit}" for name, symbol, unit in known]
    yield _judged(claim, where, f"{said}; final {', '.join(sizes)}", holds=not open_)


def _adaptation(ours: Row | None, fixed: Sequence[Row]) -> Iterator[Claim]:
    claim, where = "adaptation handles unknown mass, inertia and friction", "abstract"
    wrong = [row for row in fixed if _theta_error(row) > WRONG_THETA]
    if ours is None or not wrong:
        law = PAPER_LAW if ours is None else f"{FIXED_LAW} with a wrong Θ"
        yield _missing(claim, where, law)
        return
    for row in wrong:
        off = f"Θ off by {100 * _theta_error(row):.0f} %"
        yield _smaller(
            f"{claim}: better than {row.label}, {off}", where, ours, row, "final position error"
        )


def _simplicity(rows: Sequence[Row], ours: Row | None) -> Iterator[Claim]:
    claim, where = "a simpler law than backstepping: no explosion of complexity", "Remark 3.3"
    rival = next((row for row in rows if row.law == ANALYTIC_LAW), None)
    if ours is None or rival is None:
        yield _missing(claim, where, PAPER_LAW if ours is None else ANALYTIC_LAW)
        return
    if ours.cost is None or rival.cost is None:
        yield Claim(claim, where, "not both came through", Verdict.NOT_TESTABLE)
        return
    ratio = rival.cost.ratio / ours.cost.ratio
    measured = (
        f"a step of {rival.label} takes {ratio:.2f} times the processor time of one of"
        f" {ours.label}, adaptation included"
    )
    yield _judged(claim, where, measured, holds=ratio > MARGIN)


def _derivatives(rows: Sequence[Row], ours: Row | None) -> Iterator[Claim]:
    claim, where = "filters do better than numerical derivatives of virtual controls", "section 1"
    rival = next((row for row in rows if row.law == NUMERIC_LAW), None)
    if ours is None or rival is None:
        yield _missing(claim, where, PAPER_LAW if ours is None else NUMERIC_LAW)
        return
    if not rival.sound or rival.worst is None:
        measured = f"{rival.label}: {'; '.join(rival.troubles)}"
        yield _judged(claim, where, measured, holds=ours.sound)
        return
    yield _smaller(claim, where, ours, rival, "torque over the whole run")


def _gains(ours: Row | None, others: Sequence[Row]) -> Iterator[Claim]:
    larger = "larger k_1 … k_4, smaller γ: a smaller error"
    less = "a smaller K_5: a smaller error"
    seen = set()
    for row in others:
        if ours is not None and (
            claim := {"tighter": larger, "slower": less}.get(_change(ours, row))
        ):
            seen.add(claim)
            yield _smaller(claim, "Remark 3.4", row, ours, "final position error")
    for claim in (larger, less):
        if claim not in seen:
            yield _missing(claim, "Remark 3.4", f"{PAPER_LAW} a second time with such gains")


def _change(base: Row, row: Row) -> str:
    """How the gains of a row differ: all as one suggestion of Remark 3.4 has it, or not."""
    before, after = base.gains, row.gains
    differ = [key for key in before if before[key] != after[key]]
    if not differ:
        return ""
    if differ == ["k5"]:
        pairs = list(zip(before["k5"], after["k5"], strict=True))
        return "slower" if all(b <= a for a, b in pairs) else ""
    tighter = all(
        (key in _UP and after[key] > before[key]) or (key in _DOWN and after[key] < before[key])
        for key in differ
    )
    return "tighter" if tighter else ""


_NUMBERS = {
    "final position error": ("rms {} mm", 1e3, lambda found: found["final_position_rms_m"]),
    "torque over the whole run": (
        "rms {} N·m",
        1.0,
        lambda found: found["torque_wheel_N_m"]["rms"],
    ),
}


def _smaller(claim: str, where: str, one: Row, other: Row, what: str) -> Claim:
    """That a number of one row is smaller than that of another."""
    words, scale, of = _NUMBERS[what]
    values = [_value(row, of) for row in (one, other)]
    said = [
        words.format(_number(value, scale)) if row.sound else row.troubles[0]
        for row, value in zip((one, other), values, strict=True)
    ]
    holds = one.sound and (not other.sound or values[0] * MARGIN < values[1])
    return _judged(
        claim, where, f"{what}: {one.label} {said[0]}, {other.label} {said[1]}", holds=holds
    )


def _value(row: Row, of: Any) -> float:
    found = None if row.worst is None else of(row.worst)
    return float("inf") if found is None or not isfinite(found) else float(found)


def _theta_error(row: Row) -> float:
    found = None if row.worst is None else row.worst["theta_hat_error"]
    return 0.0 if found is None else float(found["start"])


def _number(value: float, scale: float) -> str:
    return format(scale * value, ".3g") if isfinite(value) else "no number"
