"""The verdict of a cell, and the numbers beside it.

    held        all expectations held strictly
    recovered   not so, but late: robots came back within bounds, and stayed
    failed      an expectation was broken late
    stopped     a robot stopped itself and has not armed again: its controller noticed
    diverged    the motion of a body left all bounds
    refused     the fault can't act in this scenario
    error       the cell brought no result; the reason is in its text

Of stopped and diverged the one that came first. `fleetloop.campaign.matrix` defines the windows.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from configs.errors import ScenarioError
from configs.events import KINDS, Event, told
from configs.expect import Expect
from configs.scenario import Scenario
from fleetloop.campaign.matrix import Cell, may_begin_later
from fleetloop.record.reader import Record
from fleetloop.results.expectations import judge
from fleetloop.results.tables import claim

_MOST_NOTICES = 20


class Verdict(StrEnum):
    """Of a cell, from best to worst."""

    REFUSED = "refused"
    HELD = "held"
    RECOVERED = "recovered"
    STOPPED = "stopped"
    FAILED = "failed"
    DIVERGED = "diverged"
    ERROR = "error"

    @property
    def rank(self) -> int:
        """From best to worst."""
        return list(Verdict).index(self)


def verdicts_named(text: str) -> frozenset[Verdict]:
    """The verdicts of `--allow`, held and recovered always among them.

    Raises:
        ScenarioError: there is no such verdict.
    """
    found = {Verdict.HELD, Verdict.RECOVERED}
    for name in filter(None, map(str.strip, text.split(","))):
        if name not in set(Verdict):
            known = ", ".join(Verdict)
            raise ScenarioError(f"--allow {text}: {name}: no such verdict; known: {known}")
        found.add(Verdict(name))
    return frozenset(found)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run came to, wherever it ran."""

    record: Record
    stopped: Mapping[str, str]
    """Robots that are stopped, and why."""
    events: Sequence[Event]


@dataclass(frozen=True, slots=True)
class Result:
    """A cell and what came of it."""

    cell: Cell
    verdict: Verdict
    reason: str = ""
    settle_s: float | None = None
    """Of a cell that recovered: time from the fault's begin to the last tick out of bounds [s]."""
    peak_m: float | None = None
    """The greatest position error hypot(x_e, y_e) of any robot from the fault's begin on [m]."""
    peak_robot: str = ""
    peak_at_s: float | None = None
    notices: tuple[str, ...] = ()
    """What was told from the fault's begin on."""
    command: str = ""
    wall_s: float = 0.0

    def as_table(self) -> dict[str, Any]:
        """For a file."""
        table = asdict(self)
        cell: dict[str, Any] = table.pop("cell")
        return cell | table | {"verdict": self.verdict.value}

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "Result":
        """The result again.

        Raises:
            KeyError, TypeError, ValueError: it is none.
        """
        own = {key: table[key] for key in cls.__dataclass_fields__ if key != "cell"}
        cell = Cell(str(table["kind"]), float(table["at_s"]), int(table["seed"]))
        own |= {"verdict": Verdict(own["verdict"]), "notices": tuple(own["notices"])}
        return cls(cell, **own)


def verdict_of(
    cell: Cell,
    scenario: Scenario,
    strict: Sequence[Expect],
    outcome: Outcome,
) -> Result:
    """The verdict of a run that came to its end, or to where its verdict couldn't change.

    Args:
        cell: which one it was.
        scenario: of the cell, its expectations late.
        strict: the same expectations strictly.
        outcome: of the run.
    """
    period_s = scenario.clock.control_period_s
    peak = _peak(outcome.record, cell.at_s)
    found = Result(
        cell, Verdict.HELD, **peak, notices=_notices(outcome.events, cell.at_s, period_s)
    )
    ended = [
        event
        for event in outcome.events
        if event.kind in (Verdict.STOPPED, Verdict.DIVERGED) and event.source in outcome.stopped
    ]
    if ended:
        first = min(ended, key=lambda event: event.tick)
        reason = f"{first.source}: {told(first, round(period_s * 1e9))}"
        return _but(found, Verdict(first.kind), reason)
    late = [judge(expect, outcome.record, scenario, outcome.events) for expect in scenario.expect]
    if any(one["held"] is None for one in late):
        missed = next(one for one in late if one["held"] is None)
        return _but(found, Verdict.ERROR, f"not reached: {claim(missed)}")
    if broken := [one for one in late if not one["held"]]:
        return _but(found, Verdict.FAILED, "; ".join(map(claim, broken)))
    settled = [
        kept_from_s(one, asked.from_s, outcome.record, scenario)
        for one, asked in zip(strict, scenario.expect, strict=True)
    ]
    since_s = [
        t_s
        for t_s, one in zip(settled, strict, strict=True)
        if may_begin_later(one) and t_s > one.from_s + 0.5 * period_s
    ]
    if not since_s:
        return found
    return _but(found, Verdict.RECOVERED, "", settle_s=round(max(since_s) - cell.at_s, 9))


def kept_from_s(expect: Expect, latest_s: float, record: Record, scenario: Scenario) -> float:
    """The earliest time from which on an expectation holds, searched from its `from_s` on [s].

    Args:
        expect: its `from_s` is the earliest time.
        latest_s: from then on it holds, or the search ends.
        record: of the run.
        scenario: of the run.
    """
    if not may_begin_later(expect):
        return expect.from_s
    period_s = scenario.clock.control_period_s
    low, high = round(expect.from_s / period_s), round(latest_s / period_s)

    def holds(tick: int) -> bool:
        asked = _from(expect, round(tick * period_s, 9))
        return judge(asked, record, scenario)["held"] is True

    return round(_first(holds, low, high) * period_s, 9)


def _first(holds: Callable[[int], bool], low: int, high: int) -> int:
    """The first of low … high for which it holds and for all behind it; high if there is none."""
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return high


def _from(expect: Expect, from_s: float) -> Expect:
    return replace(expect, from_s=from_s)


def _but(found: Result, verdict: Verdict, reason: str, settle_s: float | None = None) -> Result:
    return replace(found, verdict=verdict, reason=reason, settle_s=settle_s)


def _peak(record: Record, from_s: float) -> dict[str, Any]:
    """The greatest position error, its robot and its time."""
    best: dict[str, Any] = {"peak_m": None, "peak_robot": "", "peak_at_s": None}
    for robot, rows in record.controller.items():
        after = rows[rows["t_s"] >= from_s - 1e-9]
        if not {"x_e_m", "y_e_m"} <= {*(rows.dtype.names or ())} or not len(after):
            continue
        with np.errstate(all="ignore"):
            error = np.hypot(after["x_e_m"], after["y_e_m"])
        error = np.where(np.isfinite(error), error, -1.0)
        at = int(error.argmax())
        if error[at] >= 0.0 and (best["peak_m"] is None or error[at] > best["peak_m"]):
            best = {
                "peak_m": float(error[at]),
                "peak_robot": robot,
                "peak_at_s": round(float(after["t_s"][at]), 9),
            }
    return best


def _notices(events: Sequence[Event], from_s: float, period_s: float) -> tuple[str, ...]:
    first = round(from_s / period_s)
    lines = [
        f"{event.source}: {told(event, round(period_s * 1e9))}"
        for event in sorted(events, key=lambda it: it.tick)
        if event.tick >= first and KINDS[event.kind].told
    ]
    return tuple(lines[:_MOST_NOTICES])
