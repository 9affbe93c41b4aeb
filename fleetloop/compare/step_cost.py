"""Processor time of one step of a law, as a ratio to another's within one measurement.

All laws are given the same motions, the last ticks of the first law's run, in turn: a block of
steps each, then the next round. So what the machine does meanwhile, it does to all of them. A step
is the law alone: path, coordination and bus are the same for all.
"""

from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple

from agents.laws.build import build
from agents.laws.interface import PathVariable, Reference, RobotMotion
from agents.paths import robot_path
from bridge.process.clock import thread_cpu_ns
from configs.connections import NetworkLink
from configs.resolve import agent_brief
from configs.scenario import Scenario
from fleetloop.record.reader import Record

SAMPLES, ROUNDS = 400, 25


class Sample(NamedTuple):
    """What a law was told at one tick of a run, but for its path."""

    motion: RobotMotion
    along: PathVariable


class StepCost(NamedTuple):
    """Processor time of a step."""

    us: float
    """The least over the rounds, which is the one that was interrupted least [µs]."""
    ratio: float
    """To the first law, the median over the rounds."""


def samples(record: Record) -> list[Sample]:
    """The last motions of the first robot of a run."""
    rows = next(rows for rows in record.controller.values() if len(rows))
    names = ("x_used_m", "y_used_m", "theta_used_rad", "v_used_m_s", "omega_used_rad_s")
    return [
        Sample(
            RobotMotion(*(float(row[name]) for name in names)),
            PathVariable(float(row["s"]), float(row["s_dot"]), 0.0),
        )
        for row in rows[-SAMPLES:]
    ]


def step_costs(
    scenarios: Mapping[str, Scenario],
    motions: Sequence[Sample],
    clock_ns: Callable[[], int] = thread_cpu_ns,
) -> dict[str, StepCost]:
    """Cost of the step of the first robot's law in each scenario, by label.

    A law that raises at these motions has none; without the first one there is nothing.
    """
    blocks = {}
    for label, scenario in scenarios.items():
        block = _block(scenario, motions)
        if _works(block):
            blocks[label] = block
    first = next(iter(scenarios), "")
    if first not in blocks or not motions:
        return {}
    spent: dict[str, list[int]] = {label: [] for label in blocks}
    for _ in range(ROUNDS):
        for label, block in blocks.items():
            began = clock_ns()
            block()
            spent[label].append(max(clock_ns() - began, 1))
    return {
        label: StepCost(
            min(times) / len(motions) * 1e-3,
            median(one / other for one, other in zip(times, spent[first], strict=True)),
        )
        for label, times in spent.items()
    }


def _block(scenario: Scenario, motions: Sequence[Sample]) -> Callable[[], None]:
    """A step per motion, from a fresh state on."""
    network = NetworkLink("in-process", "", "", "")
    brief = agent_brief(scenario, scenario.names[0], network=network, bus=())
    path = robot_path(brief.path, brief.offset)
    law = build(brief.law, brief.wheels, brief.schedule.period_s, path)
    told: list[tuple[RobotMotion, Reference, PathVariable]] = [
        (motion, path(along.s), along) for motion, along in motions
    ]

    def run() -> None:
        state: Any = None
        step = law.step
        for motion, reference, along in told:
            _, _, state, _ = step(state, motion, reference, along)

    return run


def _works(block: Callable[[], None]) -> bool:
    try:
        block()
    except Exception:  # the user's own code: whatever it is, there is nothing to measure
        return False
    return True
