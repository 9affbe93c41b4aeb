"""Many cases, one after the other, by the compiled loop."""

from collections.abc import Collection, Sequence
from typing import Final

from bridge.process.lifecycle import Stop
from configs.scenario import Scenario
from fleetloop.sweep.kernel import loop
from fleetloop.sweep.kernel.compilation import Simulate, compiled_loop
from fleetloop.sweep.kernel.coverage import lacks
from fleetloop.sweep.kernel.lowering import lowered
from fleetloop.sweep.kernel.outcome import KernelOutcome, columns, controller_table, record_of
from fleetloop.sweep.kernel.reference import arming, referred

_LEFT: Final = {
    loop.PATH_VARIABLE: "a path variable diverged",
    loop.POSE: "a robot left the world",
    loop.TORQUE: "a law asked for a torque that is not finite",
    loop.BODY: "the motion of a body diverged",
    loop.TURN: "a heading diverged",
}


def run(
    scenarios: Sequence[Scenario], signals: Collection[str], stop: Stop
) -> list[KernelOutcome]:
    """Run cases; with a stop, those before it.

    A case in which a robot stops itself or diverges is run again by the in-process reference, from
    its beginning: `KernelOutcome.left_course` says so.

    Args:
        scenarios: of which `lacks` says nothing.
        signals: names of what has to be in the records.
        stop: ends it after the case that is being run.

    Raises:
        ValueError: a scenario isn't covered.
        InfrastructureError: the drives were not armed when control had to start.
    """
    simulate, asked = compiled_loop(), frozenset(signals)
    outcomes = []
    for scenario in scenarios:
        if stop.requested:
            break
        outcomes.append(_run_one(simulate, scenario, asked, stop))
    return outcomes


def _run_one(
    simulate: Simulate, scenario: Scenario, asked: frozenset[str], stop: Stop
) -> KernelOutcome:
    if lacking := lacks(scenario):
        raise ValueError(f"{scenario.name}: the kernel has no {lacking}")
    made = lowered(scenario)
    kept = columns(controller_table(scenario), asked)
    room = [one.rows(len(made.robots), made.schedule.ticks) for one in kept]
    why, tick, number = simulate(
        *(made.case, made.robots, made.states, made.edges, made.leader_m_s, made.curves),
        (kept[0].numbers, kept[1].numbers),
        (room[0][0], room[1][0]),
    )
    if why != loop.NOTHING:
        where = f"{_LEFT[why]} ({scenario.names[number]}, {made.schedule.when(tick)})"
        return referred(scenario, stop, where)
    return KernelOutcome(record_of(scenario, kept, room[0][1], room[1][1]), {}, arming(scenario))
