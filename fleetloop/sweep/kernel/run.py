"""Many cases, one after the other, by the compiled loop."""

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from bridge.process.lifecycle import Stop
from configs.brief import Schedule
from configs.events import Event
from configs.resolve import schedule
from configs.scenario import Scenario
from configs.signals import AGE_PREFIX, age_signals
from fleetloop.sweep.kernel import layout, loop
from fleetloop.sweep.kernel.compilation import compiled_loop
from fleetloop.sweep.kernel.coverage import lacks
from fleetloop.sweep.kernel.hearing import ages_s
from fleetloop.sweep.kernel.lowering import Case, Records, lowered
from fleetloop.sweep.kernel.outcome import (
    Columns,
    KernelOutcome,
    Rows,
    columns,
    record_of,
    with_ages,
)
from fleetloop.sweep.kernel.reference import arming, referred
from fleetloop.sweep.kernel.stops import divergences, stop_events

_MOST_MAPS: Final = 64
"""Degrees of which maps are remembered."""
_LEFT: Final = {
    loop.PATH_VARIABLE: "a path variable diverged",
    loop.POSE: "a robot left the world",
    loop.TURN: "a heading diverged",
    loop.REARMING: "a robot that stopped itself may arm again",
}


def run(scenarios: Sequence[Scenario], signals: Collection[str], stop: Stop) -> list[KernelOutcome]:
    """Run cases; with a stop, those before it.

    A case that leaves the course that the loop can follow is run again by the in-process reference,
    from its beginning: `KernelOutcome.left_course` says so.

    Args:
        scenarios: of which `lacks` says nothing.
        signals: names of what has to be in the records.
        stop: ends it after the case that is being run.

    Raises:
        ValueError: a scenario isn't covered.
        InfrastructureError: the drives were not armed when control had to start.
    """
    asked, compiled = frozenset(signals), Loop()
    outcomes = []
    for scenario in scenarios:
        if stop.requested:
            break
        outcomes.append(_run_one(scenario, asked, compiled, stop))
    return outcomes


class Loop:
    """The compiled loop, with the memory that the cases of a call have in common."""

    def __init__(self) -> None:
        self._simulate = compiled_loop()
        self._rows = layout.one(layout.TRUTH), layout.one(layout.TOLD)
        self._maps: dict[tuple[float, float, float], Records] = {}

    def run(
        self, case: Case, kept: tuple[Columns, Columns], room: tuple[Rows, Rows]
    ) -> tuple[int, int, int]:
        """Run a case; its states become those of the end.

        Args:
            case: at tick 0.
            kept: columns of the plant's rows and of the controllers'.
            room: for these.

        Returns:
            as `loop.simulate`.
        """
        return self._simulate(
            *(case.cases, case.robots, case.states, case.edges, case.changes),
            *(case.leader_m_s, case.curves, self._maps_of(case.cases[0]), self._rows),
            (kept[0].numbers, kept[1].numbers),
            room,
        )

    def _maps_of(self, case: np.void) -> Records:
        """The coordination's maps that were computed, of all cases that have these gains."""
        key = float(case["p"]), float(case["q"]), float(case["period_s"])
        return self._maps.setdefault(key, np.zeros(_MOST_MAPS, layout.MAP))


def _run_one(
    scenario: Scenario, asked: frozenset[str], compiled: Loop, stop: Stop
) -> KernelOutcome:
    if lacking := lacks(scenario):
        raise ValueError(f"{scenario.name}: the kernel has no {lacking}")
    ticks = schedule(scenario)
    made = lowered(scenario, ticks)
    kept = columns(asked)
    room = [one.rows(len(made.robots), ticks.ticks, ticks.period_ns) for one in kept]
    why, tick, number = compiled.run(made, kept, (room[0][0], room[1][0]))
    if why != loop.NOTHING:
        where = f"{_LEFT[why]} ({scenario.names[number]}, {ticks.when(tick)})"
        return referred(scenario, stop, where)
    controller = dict(zip(scenario.names, room[1][1], strict=True))
    tables = dict.fromkeys(scenario.names, kept[1].signals)
    if scenario.ages_vary and any(name.startswith(AGE_PREFIX) for name in asked):
        for robot, without in controller.items():
            ages = {
                speaker: ages_s(made.heard[robot][speaker], ticks)
                for speaker in scenario.aged(robot)
                if age_signals((speaker,))[0].name in asked
            }
            controller[robot], tables[robot] = with_ages(without, kept[1].signals, ages)
    record = record_of(scenario, room[0][1], controller, tables)
    return KernelOutcome(record, *_events(scenario, made.states, ticks))


def _events(
    scenario: Scenario, states: Records, ticks: Schedule
) -> tuple[dict[str, str], list[Event]]:
    """The robots that stopped, and why; all events."""
    armed = arming(scenario, ticks)
    if not (states["stopped"].any() or states["diverged"].any()):
        return {}, armed
    of_plant = divergences(scenario, states, ticks)
    stopped: dict[str, str] = {}
    events = list(of_plant)
    for robot, state in zip(scenario.names, states, strict=True):
        of_robot = stop_events(scenario, robot, state)
        events += [*(event for event in armed if event.source == robot), *of_robot]
        if of_robot:
            stopped[robot] = f"{ticks.when(of_robot[-1].tick)}: {of_robot[-1].text}"
    diverged = sorted(of_plant, key=lambda event: scenario.names.index(event.source))
    stopped |= {event.source: f"{ticks.when(event.tick)}: {event.text}" for event in diverged}
    return stopped, events
