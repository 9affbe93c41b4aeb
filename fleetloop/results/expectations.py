"""Expectations of a scenario against a record: one holds only if its whole window was recorded.

held         by every robot, or pair of robots, that it is about
FAILED       by one of them not, whatever the rest of the window held; or a value isn't finite
not reached  neither: some robot's rows end before the window does, or before it begins

verdict      of a run that came to its end
failed       a robot stopped itself, or an expectation failed
not checked  else, if an expectation was not reached, a robot was cut short, or nothing is expected
held         else
"""

from collections import Counter
from collections.abc import Sequence
from math import ceil, inf, isnan
from typing import Any, NamedTuple

import numpy as np

from configs.events import MAX_EVENTS, Event
from configs.expect import BOUNDS, COUNTS, Expect, Window, claim, window_of
from configs.scenario import Scenario
from configs.signals import DERIVED_SIGNALS, PLANT_SIGNALS, SPREAD
from fleetloop.record.reader import Record
from fleetloop.results import robustness
from fleetloop.results.robustness import Finding
from fleetloop.results.series import Alike, Series, SeriesOf

Judged = dict[str, Any]
"""An expectation as in summary.json: its keys, and

    claim       what it says, as a sentence
    window      the ticks that it is about, as from_s and to_s in scenario time [s]
    held        None: not reached
    value       at the worst tick; of settle_within_s the time to settle [s], of events their number
    worst       that tick: robots, tick, t_s; None if there is none
    bound       the key of the bound that is nearest to the value, and the bound
    margin      from the bound, negative if broken; of settle_within_s [s]
    unit        of value, bound and margin
    seen_to_s   if not reached: how far the window was recorded
"""


class _Part(NamedTuple):
    """A series and what was found of it."""

    series: Series
    first: int  # tick of the first value that counts
    finding: Finding


def judge(
    expect: Expect,
    record: Record,
    scenario: Scenario,
    events: Sequence[Event] | None = None,
    series_of: SeriesOf | None = None,
) -> Judged:
    """Compare an expectation with the record; a robot counts while it is a member.

    Where one has no rows of its controller, which was started again, the window isn't reached.

    Args:
        expect: one that was checked against the scenario.
        record: of the run, complete or not.
        scenario: of the run.
        events: all of the run; None: they aren't known, and none of them is reached.
        series_of: of the record, where several expectations are judged.
    """
    series_of = series_of or SeriesOf(record, scenario)
    window = window_of(expect, scenario, scenario.ends_at_s) or Window(0, -1)
    period_s = scenario.clock.control_period_s
    judged: Judged = {**expect.stated, "claim": claim(expect)}
    judged["window"] = {
        "from_s": round(window.first * period_s, 9),
        "to_s": round(window.last * period_s, 9),
    }
    if expect.event is not None:
        return judged | _judge_events(expect, record, window, period_s, events)
    parts, seen = [], []
    alike = series_of.alike(expect.signal or "", expect.robots or ())
    if alike is not None and _at_every_tick(expect):
        parts = _least_of(expect, alike, window)
        seen = [alike.values.shape[1]]
    for series in () if parts else series_of(expect.signal or "", expect.robots or ()):
        first = max(window.first, series.member.joins_tick)
        behind = min(window.last + 1, series.member.leaves_tick)
        # A window that begins after the end of the run counts a robot that is a member then.
        if first < min(max(window.last, window.first) + 1, series.member.leaves_tick):
            seen.append(len(series.values))
        if first < behind:
            parts.append(_Part(series, first, _find(expect, series, first, behind, period_s)))
    held = _all_held([part.finding.held for part in parts])
    judged |= {"held": held, **_worst(expect, parts, record, period_s)}
    judged["unit"] = _unit(expect, record)
    if held is None:
        judged["seen_to_s"] = _seen_to_s(seen, period_s)
    return judged


def _all_held(held: Sequence[bool | None]) -> bool | None:
    if False in held:
        return False
    return None if None in held or not held else True


# --- signals --------------------------------------------------------------------------------------


def _least_of(expect: Expect, alike: Alike, window: Window) -> list[_Part]:
    """Of series that count at all ticks the one with the least margin; none without a tick.

    Whether it holds is whether all of them do: all have as many ticks.
    """
    values = alike.values[:, window.first : window.first + len(window)]
    if not values.size:
        return []
    g = _slack(expect, values)
    row = int(g.argmin()) // g.shape[1]
    finding = robustness.always(g[row], len(window))
    return [_Part(alike.series(row), window.first, finding)]


def _at_every_tick(expect: Expect) -> bool:
    return expect.holds == "always" and expect.quantile is None and expect.settle_within_s is None


def _slack(expect: Expect, values: np.ndarray) -> np.ndarray:
    return robustness.slack(
        values,
        least=-inf if expect.min is None else expect.min,
        most=inf if expect.max is None else expect.max,
        widest=inf if expect.max_abs is None else expect.max_abs,
    )


def _find(expect: Expect, series: Series, first: int, behind: int, period_s: float) -> Finding:
    """What the ticks from `first` to before `behind` say."""
    g = _slack(expect, series.values[first:behind])
    if not series.all_known:
        g[~series.known[first:behind]] = np.nan
    ticks = behind - first
    if _at_every_tick(expect):
        return robustness.always(g, ticks)
    broken = g == -inf
    if broken.any():  # no number, whatever was expected of it
        return Finding(False, -inf, int(np.argmax(broken)))
    piece = 1 if expect.for_s is None else ceil(expect.for_s / period_s - 1e-6) + 1
    match expect.holds:
        case "never":
            return robustness.never(g, ticks, piece)
        case "eventually":
            return robustness.eventually(g, ticks, piece)
    if expect.quantile is not None:
        return robustness.share(g, ticks, expect.quantile)
    return robustness.settles(g, ticks, period_s, expect.settle_within_s or 0.0)


def _worst(expect: Expect, parts: Sequence[_Part], record: Record, period_s: float) -> Judged:
    """Value, bound and margin of the series with the least margin; the failed ones first."""
    found = [part for part in parts if part.finding.at is not None]
    if not found:
        return {"value": None, "worst": None, "bound": None, "margin": None}

    def rank(part: _Part) -> tuple[bool, float]:
        held, margin, *_ = part.finding
        return held is not False, inf if isnan(margin) else margin

    series, first, finding = min(found, key=rank)
    tick = first + (finding.at or 0)
    value = float(series.values[tick])
    spread_out = expect.signal == SPREAD
    robots = _farthest(series, tick, record) if spread_out else list(series.robots)
    worst = _place(robots, tick, period_s)
    margin = None if isnan(finding.margin) else finding.margin
    if expect.settle_within_s is not None:
        bound: Judged = {"settle_within_s": expect.settle_within_s}
        return {"value": finding.settled_s, "worst": worst, "bound": bound, "margin": margin}
    return {"value": value, "worst": worst, "bound": _bound(expect, value), "margin": margin}


def _bound(expect: Expect, value: float) -> Judged:
    """The bound that is nearest to a value, or farthest outside it."""
    rooms = {"max_abs": lambda b: b - abs(value), "min": lambda b: value - b}
    rooms["max"] = lambda b: b - value
    given = {key: getattr(expect, key) for key in BOUNDS if getattr(expect, key) is not None}
    key = min(given, key=lambda key: rooms[key](given[key]))
    return {key: given[key]}


def _place(robots: Sequence[str], tick: int, period_s: float) -> Judged:
    return {"robots": list(robots), "tick": tick, "t_s": round(tick * period_s, 9)}


def _seen_to_s(lengths: Sequence[int], period_s: float) -> float:
    """Time of the last tick that all have."""
    return round(max((min(lengths, default=0) - 1) * period_s, 0.0), 9)


def _farthest(series: Series, tick: int, record: Record) -> list[str]:
    """The robots whose path variables are farthest apart."""
    s = {robot: record.controller[robot]["s"][tick] for robot in series.robots}
    known = {robot: value for robot, value in s.items() if not isnan(value)}
    ends = [max(known, key=known.__getitem__), min(known, key=known.__getitem__)] if known else []
    return list(dict.fromkeys(ends))


def _unit(expect: Expect, record: Record) -> str:
    if expect.settle_within_s is not None:
        return "s"
    tables = (PLANT_SIGNALS, DERIVED_SIGNALS, *record.signals.values())
    named = (it.unit for table in tables for it in table if it.name == expect.signal)
    return next(named, "")


# --- events ---------------------------------------------------------------------------------------


def _judge_events(
    expect: Expect,
    record: Record,
    window: Window,
    period_s: float,
    events: Sequence[Event] | None,
) -> Judged:
    """Count events of each robot that is named, or of all sources together."""
    of_kind = [it for it in events or () if it.kind == expect.event and _in(window, it, expect)]
    ends = _known_to(record, events)
    counts = []
    for robot in expect.robots or ("",):
        own = [event for event in of_kind if robot in ("", event.source)]
        seen = ends[robot] if robot else min(ends.values(), default=0)
        counts.append(_Count(robot, own, *_compared(expect, len(own), whole=seen > window.last)))
    held = _all_held([count.held for count in counts])
    worst = min(counts, key=lambda count: (count.held is not False, count.margin))
    bounds = {key: value for key in COUNTS if (value := getattr(expect, key)) is not None}
    key = min(bounds, key=lambda key: abs(bounds[key] - len(worst.events)))
    judged: Judged = {"held": held, "value": len(worst.events), "worst": None}
    if worst.events:
        first = worst.events[0]
        judged["worst"] = _place([first.source], first.tick, period_s)
    elif worst.robot:
        judged["worst"] = {"robots": [worst.robot], "tick": None, "t_s": None}
    judged |= {"bound": {key: bounds[key]}, "margin": worst.margin, "unit": ""}
    if held is None:
        judged["seen_to_s"] = _seen_to_s([ends[r] for r in expect.robots or ends], period_s)
    return judged


def _known_to(record: Record, events: Sequence[Event] | None) -> dict[str, int]:
    """The tick before which all events of a robot are known: of too many the last aren't kept."""
    if events is None:
        return dict.fromkeys(record.robots, 0)
    ends = {robot: len(record.controller[robot]) for robot in record.robots}
    counts = Counter(event.source for event in events)
    for robot in record.robots:
        if counts[robot] >= MAX_EVENTS:
            last = max(event.tick for event in events if event.source == robot)
            ends[robot] = min(ends[robot], max(last, 0))
    return ends


class _Count(NamedTuple):
    """Events of one robot, or of all sources."""

    robot: str
    events: list[Event]
    held: bool | None
    margin: int


def _compared(expect: Expect, count: int, *, whole: bool) -> tuple[bool | None, int]:
    """Whether a count of events holds, and the margin; `whole`: no more can come."""
    least, most = expect.at_least, expect.at_most
    margins = [] if least is None else [count - least]
    margins += [] if most is None else [most - count]
    margin = min(margins)
    if most is not None and count > most:
        return False, margin
    if least is not None and count < least:
        return False if whole else None, margin
    return True if whole or most is None else None, margin


def _in(window: Window, event: Event, expect: Expect) -> bool:
    """Whether an event is in a window; one from the start on has the countdown in it."""
    from_start = window.first == 0 and expect.reference is None
    return (from_start or event.tick >= window.first) and event.tick <= window.last


# --- the run --------------------------------------------------------------------------------------


def verdict(expected: Sequence[Judged], *, stopped: bool, cut_short: bool) -> str:
    """The verdict of a run that came to its end; see the table above."""
    if stopped or any(item["held"] is False for item in expected):
        return "failed"
    if cut_short or not expected or any(item["held"] is None for item in expected):
        return "not checked"
    return "held"


def why_not_checked(expected: Sequence[Judged], cut_short: dict[str, str]) -> str:
    """Why a run that came to its end is not checked."""
    if cut_short:
        return "; ".join(f"{robot}: {how}" for robot, how in cut_short.items())
    if not expected:
        return "the scenario expects nothing"
    missed = [item["held"] for item in expected].count(None)
    return f"{missed} of {len(expected)} expectations not reached"


def out_of_reach(scenario: Scenario) -> list[str]:
    """What a run can't check that ends before its scenario does, a line each."""
    end_s = scenario.ends_at_s
    ticks = ceil(end_s / scenario.clock.control_period_s - 1e-6)
    lines = []
    for expect in scenario.expect:
        window = window_of(expect, scenario, end_s)
        if window is None or not len(window) or window.last >= ticks:
            lines.append(f"not checked: {claim(expect)}; the run ends at {end_s:g} s")
    return lines
