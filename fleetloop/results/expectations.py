"""Expectations of a scenario against a record: one holds only if its whole window was recorded.

held         the window was reached to its end by every robot that it is about, within the bounds
FAILED       a bound was broken, or a value isn't finite; whatever the rest of the window held
not reached  neither: some robot's rows end before the window does, or before it begins

verdict      of a run that came to its end
failed       a robot stopped itself, or an expectation failed
not checked  else, if an expectation was not reached, a robot was cut short, or nothing is expected
held         else
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from configs.membership import ALWAYS, Membership
from configs.scenario import Scenario
from configs.sections import Expect
from configs.signals import PLANT_SIGNALS, SPREAD
from fleetloop.record.reader import Record

_OF_PLANT = {signal.name for signal in PLANT_SIGNALS} - {"t_s"}

Judged = dict[str, Any]
"""An expectation with `held` (None: not reached), `found` and, if not reached, `seen_to_s`."""


def spread(controllers: Mapping[str, np.ndarray], members: Mapping[str, Membership]) -> np.ndarray:
    """max_i s_i − min_i s_i over the members at every tick at which all robots have a row."""
    ticks = min(len(rows) for rows in controllers.values())
    there = [counted(rows, members[robot])[:ticks] for robot, rows in controllers.items()]
    s = [rows["s"][:ticks] for rows in controllers.values()]
    return spread_of(np.stack(s, axis=1), np.stack(there, axis=1))


def _mask(member: Membership, ticks: int) -> np.ndarray:
    """By tick, whether a robot is a member."""
    there = np.zeros(ticks, dtype=bool)
    there[member.ticks] = True
    return there


def counted(rows: np.ndarray, member: Membership) -> np.ndarray:
    """Rows of a controller at which its robot is a member; not those until it has re-joined."""
    there: np.ndarray = _mask(member, len(rows)) & ~np.isnan(rows["s"])
    return there


def spread_of(s: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Max − min of each row over those that are there, 0 without any."""
    most = np.where(there, s, -np.inf).max(axis=1)
    least = np.where(there, s, np.inf).min(axis=1)
    difference: np.ndarray = np.where(there.any(axis=1), most - least, 0.0)
    return difference


def judge(expect: Expect, record: Record, scenario: Scenario) -> Judged:
    """Compare an expectation with the record; a robot counts while it is a member.

    Where one has no rows of its controller, which was started again, the window isn't reached.
    """
    period_s = scenario.clock.control_period_s
    end_s = scenario.ends_at_s if expect.to_s is None else expect.to_s
    parts, seen_s, whole = [], [], True
    for member, t, series, known in _series(expect, record, scenario):
        to_s = min(end_s, member.leaves_tick * period_s)
        if not member.overlaps(expect.from_s / period_s, end_s / period_s):
            continue
        window = _mask(member, len(t)) & (t >= expect.from_s) & (t <= end_s)
        part = series[window & known]
        seen_s.append(float(t[-1]) if len(t) else 0.0)
        # The last tick of a window may be up to a period before its end.
        whole &= 0 < len(part) == window.sum() and seen_s[-1] > to_s - 1.01 * period_s
        parts.append(part)
    values = np.concatenate(parts) if parts else np.empty(0)
    judged: Judged = {k: v for k, v in asdict(expect).items() if v is not None}
    judged |= {"held": None, "found": None}
    if len(values):
        found = {"max_abs": float(np.max(np.abs(values)))}
        found |= {"min": float(values.min()), "max": float(values.max())}
        held = _within(expect, values, found)
        judged |= {"held": held if whole or not held else None, "found": found}
    return (
        judged
        if judged["held"] is not None
        else judged | {"seen_to_s": round(min(seen_s, default=0.0), 9)}
    )


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
    lines = []
    for expect in scenario.expect:
        if expect.from_s >= end_s or (expect.to_s is not None and expect.to_s > end_s):
            until = f" to {expect.to_s:g} s" if expect.to_s is not None else ""
            window = f"{expect.signal} from {expect.from_s:g} s{until}"
            lines.append(f"not checked: {window}, the run ends at {end_s:g} s")
    return lines


def _series(
    expect: Expect, record: Record, scenario: Scenario
) -> list[tuple[Membership, np.ndarray, np.ndarray, np.ndarray]]:
    """When it counts, times, values, and whether they are known: of a spread one for all robots."""
    robots = expect.robots or record.robots
    if expect.signal == SPREAD:
        rows = {robot: record.controller[robot] for robot in robots}
        values = spread(rows, scenario.members)
        known = np.ones(len(values), dtype=bool)
        for robot, part in rows.items():
            member = scenario.members[robot]
            known &= (counted(part, member) | ~_mask(member, len(part)))[: len(values)]
        return [(ALWAYS, rows[robots[0]]["t_s"][: len(values)], values, known)]
    of_plant = expect.signal in _OF_PLANT
    source = record.plant if of_plant else record.controller
    found = []
    for robot in robots:
        own, member = source[robot], scenario.members[robot]
        if expect.signal in (own.dtype.names or ()):
            known = np.ones(len(own), dtype=bool) if of_plant else counted(own, member)
            found.append((member, own["t_s"], own[expect.signal], known))
    return found


def _within(expect: Expect, values: np.ndarray, found: dict[str, float]) -> bool:
    held = bool(np.isfinite(values).all())
    held &= expect.max_abs is None or found["max_abs"] <= expect.max_abs
    held &= expect.min is None or found["min"] >= expect.min
    held &= expect.max is None or found["max"] <= expect.max
    return held
