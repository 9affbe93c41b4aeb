"""Checks of [[expect]]: keys that belong together, and what the scenario has to offer."""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from math import ceil, inf
from typing import TYPE_CHECKING

from pydantic import ValidationError

from configs.edge_checks import robot_problems
from configs.errors import Problem
from configs.events import KINDS
from configs.expect import BOUNDS, COUNTS, REFERENCES, Expect, Window, window_of
from configs.faults.plan import fault_window, names_of
from configs.signals import (
    AGE_PREFIX,
    DERIVED_SIGNALS,
    DISTANCE,
    PLANT_SIGNALS,
    SPREAD,
    Signal,
    controller_signals,
)
from configs.wording import MISSING, guess

if TYPE_CHECKING:
    from configs.scenario import Scenario

_Table = tuple[str, frozenset[str] | None]
"""A robot and its controller's signals; None: its law isn't here, of a record."""
_OF_ALL = frozenset(signal.name for signal in (*PLANT_SIGNALS, *DERIVED_SIGNALS)) - {"t_s"}
"""Signals that every robot has."""
_OF_SIGNALS = (*BOUNDS, "for_s", "quantile", "settle_within_s")


def expect_problems(scenario: "Scenario", *, sound_edges: bool) -> Iterator[Problem]:
    """Expectations that nothing could meet or break, or that say two things."""
    tables = list(_tables(scenario, sound_edges=sound_edges)) if scenario.expect else []
    for n, expect in enumerate(scenario.expect):
        where = f"expect.{n}"
        if expect.signal is None and expect.event is None:
            yield Problem(f"{where}.signal", MISSING, "must be given, or event instead")
            continue
        if expect.signal is not None and expect.event is not None:
            remedy = "a signal is given as well: one of both, each in an [[expect]] of its own"
            yield Problem(f"{where}.event", expect.event, remedy)
            continue
        yield from robot_problems(scenario.names, f"{where}.robots", expect.robots or ())
        if expect.event is not None:
            yield from _of_event(where, expect, expect.event)
        elif expect.signal is not None:
            if expect.signal.startswith(AGE_PREFIX) and not sound_edges:
                continue  # named after an edge
            yield from _of_signal(where, expect, expect.signal, tables, scenario)
        reference = list(_reference(where, expect, scenario))
        yield from reference
        if not reference:
            yield from _window(where, expect, scenario)


def _tables(scenario: "Scenario", *, sound_edges: bool) -> Iterator[_Table]:
    """The signals of each robot whose law and gains are right."""
    for robot in scenario.robot:
        try:
            control = scenario.control_of(robot)
        except ValidationError:  # said already
            continue
        if control.recorded:
            yield robot.name, None
            continue
        aged = scenario.aged(robot.name) if sound_edges else ()
        yield robot.name, _names(control.load().SIGNALS, aged)


@lru_cache(maxsize=256)
def _names(law: tuple[Signal, ...], aged: tuple[str, ...]) -> frozenset[str]:
    return frozenset(signal.name for signal in controller_signals(law, aged))


def _expectable(tables: Iterable[_Table], robots: Sequence[str]) -> frozenset[str]:
    """Signals that all of these robots have, or some robot if none is named.

    Nothing if a law isn't here.
    """
    named: set[frozenset[str]] = set()
    for robot, table in tables:
        if robots and robot not in robots:
            continue
        if table is None:
            return frozenset()
        named.add(table)
    if not named:
        return frozenset()
    return _together(frozenset(named), every=bool(robots))


@lru_cache(maxsize=256)
def _together(tables: frozenset[frozenset[str]], *, every: bool) -> frozenset[str]:
    """Signals of every table, or of any, and those that every robot has."""
    of_all = frozenset.intersection if every else frozenset.union
    return (_OF_ALL | of_all(*tables)) - {"t_s"}


# --- what is expected -----------------------------------------------------------------------------


def _of_event(where: str, expect: Expect, event: str) -> Iterator[Problem]:
    if event not in KINDS:
        known = ", ".join(KINDS)
        remedy = f"no such kind of event{guess(event, list(KINDS), cutoff=0.5)} (known: {known})"
        yield Problem(f"{where}.event", event, remedy)
    for key in _OF_SIGNALS:
        if (value := getattr(expect, key)) is not None:
            remedy = "of signals; events are counted: at_least, at_most"
            yield Problem(f"{where}.{key}", value, remedy)
    if expect.holds != "always":
        instead = "at_most = 0" if expect.holds == "never" else "at_least = 1"
        yield Problem(f"{where}.holds", expect.holds, f"of signals; of an event say {instead}")
    elif expect.at_least is None and expect.at_most is None:
        remedy = "give at_least or at_most; at_most = 0 says never"
        yield Problem(where, event, remedy)
    elif expect.at_least == 0 and expect.at_most is None:
        yield Problem(f"{where}.at_least", 0, "holds anyway: 1 or more, or at_most = 0 for never")
    elif expect.at_most is not None and (expect.at_least or 0) > expect.at_most:
        remedy = f"must be at most at_most = {expect.at_most}"
        yield Problem(f"{where}.at_least", expect.at_least, remedy)


def _of_signal(
    where: str, expect: Expect, signal: str, tables: Sequence[_Table], scenario: "Scenario"
) -> Iterator[Problem]:
    expectable = _expectable(tables, expect.robots or ())
    if expectable and signal not in expectable:
        known = sorted(expectable)
        hint = guess(signal, known, cutoff=0.5)
        remedy = f"no such signal{hint} (known: {', '.join(known)})"
        yield Problem(f"{where}.signal", signal, remedy)
    among = expect.robots or scenario.names
    if signal == DISTANCE and len(set(among)) < 2:
        remedy = "a distance is between robots: name two or more of them"
        yield Problem(f"{where}.robots", list(among), remedy)
    for key in COUNTS:
        if (value := getattr(expect, key)) is not None:
            yield Problem(f"{where}.{key}", value, f"counts events; of a signal {_or(BOUNDS)}")
    yield from _bounds(where, expect, signal)
    yield from _modes(where, expect)


def _bounds(where: str, expect: Expect, signal: str) -> Iterator[Problem]:
    if all(getattr(expect, key) is None for key in BOUNDS):
        yield Problem(where, signal, f"give {_or(BOUNDS)}")
    most = inf if expect.max is None else expect.max
    least = -inf if expect.min is None else expect.min
    widest = inf if expect.max_abs is None else expect.max_abs
    if least > most:
        yield Problem(f"{where}.min", least, f"must be at most max = {most:g}: nothing is both")
    elif least > widest:
        yield Problem(f"{where}.min", least, f"must be at most max_abs = {widest:g}")
    elif most < -widest:
        yield Problem(f"{where}.max", most, f"must be at least -max_abs = {-widest:g}")


def _modes(where: str, expect: Expect) -> Iterator[Problem]:
    if expect.holds == "always":
        if expect.for_s is not None:
            remedy = 'always is the whole window: leave it out, or holds = "eventually" or "never"'
            yield Problem(f"{where}.for_s", expect.for_s, remedy)
        if expect.quantile is not None and expect.settle_within_s is not None:
            remedy = "of all ticks once settled: leave it out, or settle_within_s"
            yield Problem(f"{where}.quantile", expect.quantile, remedy)
        return
    for key in ("quantile", "settle_within_s"):
        if (value := getattr(expect, key)) is not None:
            remedy = f'of holds = "always": leave out one of both; {expect.holds} may have for_s'
            yield Problem(f"{where}.{key}", value, remedy)


def _or(keys: Sequence[str]) -> str:
    return f"{', '.join(keys[:-1])} or {keys[-1]}"


# --- when -----------------------------------------------------------------------------------------


def _reference(where: str, expect: Expect, scenario: "Scenario") -> Iterator[Problem]:
    """What the window is relative to."""
    given = [key for key in REFERENCES if getattr(expect, key) is not None]
    if len(given) > 1:
        remedy = f"a window has one of {', '.join(REFERENCES)}: leave out {_or(given[::-1])}"
        yield Problem(f"{where}.{given[1]}", getattr(expect, given[1]), remedy)
    elif given:
        yield from _fault(f"{where}.{given[0]}", given[0], getattr(expect, given[0]), scenario)
    if expect.before is not None and expect.to_s is not None:
        remedy = f"ends before {expect.before} acts: leave it out"
        yield Problem(f"{where}.to_s", expect.to_s, remedy)


def _fault(where: str, key: str, name: str, scenario: "Scenario") -> Iterator[Problem]:
    names = names_of(scenario.fault)
    acts = fault_window(scenario, name)
    if acts is None:
        known = f" (known: {', '.join(names)})" if names else "; the scenario has no [[fault]]"
        yield Problem(where, name, f"no fault of this name{guess(name, names)}{known}")
    elif key == "during" and acts[0] == acts[1]:
        yield Problem(where, name, "happens at an instant: after instead of during")
    elif key == "after_end" and acts[1] is None:
        yield Problem(where, name, "acts to the end: give it for_s, or after instead of after_end")


def _window(where: str, expect: Expect, scenario: "Scenario") -> Iterator[Problem]:
    """A window has a tick in it, and the scenario reaches it; a run may end before, on demand."""
    end_s, period_s = max(scenario.duration_s, scenario.ends_at_s), scenario.clock.control_period_s
    window = window_of(expect, scenario, end_s)
    if window is None:
        return
    begin_s = window.first * period_s - expect.from_s
    since = "" if expect.reference is None else f", counted from {begin_s:g} s"
    run_ticks = ceil(end_s / period_s - 1e-6)
    if expect.to_s is not None and expect.from_s >= expect.to_s:
        yield Problem(f"{where}.from_s", expect.from_s, f"must be below to_s = {expect.to_s:g}")
    elif window.first >= run_ticks:
        remedy = f"the run ends before: must be below duration_s = {end_s:g}{since}"
        yield Problem(f"{where}.from_s", expect.from_s, remedy)
    elif not len(window):
        last_s = window.last * period_s
        remedy = f"no tick from there to {last_s:g} s: they are {period_s:g} s apart"
        yield Problem(f"{where}.from_s", expect.from_s, remedy)
    else:
        yield from _length(where, expect, window, period_s)
        yield from _absent(where, expect, window, scenario)
    if expect.to_s is not None and begin_s + expect.to_s > end_s + 1e-9:
        remedy = (
            f"the run ends before: at most duration_s = {end_s:g}{since},"
            " or leave it out: to the end"
        )
        yield Problem(f"{where}.to_s", expect.to_s, remedy)


def _length(where: str, expect: Expect, window: Window, period_s: float) -> Iterator[Problem]:
    """Nothing takes longer than the window."""
    length_s = (len(window) - 1) * period_s
    for key in ("for_s", "settle_within_s"):
        value = getattr(expect, key)
        if value is not None and value > length_s + 1e-9:
            remedy = f"longer than the window, {length_s:g} s: less, or a longer window"
            yield Problem(f"{where}.{key}", value, remedy)


def _absent(where: str, expect: Expect, window: Window, scenario: "Scenario") -> Iterator[Problem]:
    """Robots of which nothing counts in the window."""
    named = [robot for robot in expect.robots or () if robot in scenario.names]
    absent = [r for r in named if not scenario.members[r].overlaps(window.first, window.last)]
    if absent and expect.signal not in (None, SPREAD):
        remedy = f"{', '.join(absent)} joins later or has left: nothing of it counts then"
        yield Problem(f"{where}.robots", list(expect.robots or ()), remedy)
