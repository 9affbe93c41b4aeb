"""The in-process reference, for what the loop leaves to it: cases off the ordinary course; arming.

Before tick 0 the drives are armed, in the same way in all cases with the same drives and the same
clock: one robot of the first of them is armed by the reference, and all others are as it was.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Final

from bridge.process.lifecycle import Stop
from configs.brief import Schedule
from configs.connections import NetworkLink
from configs.events import Event
from configs.resolve import agent_brief, leader_brief, plant_brief, signals_of
from configs.scenario import Scenario
from fleetloop.in_process.run import InProcessRun
from fleetloop.record.memory import MemoryRecord
from fleetloop.sweep.kernel.layout import CONTROLLER_SIGNALS
from fleetloop.sweep.kernel.outcome import KernelOutcome

_NETWORK: Final = NetworkLink("in-process", "", "", "")


def referred(scenario: Scenario, stop: Stop, left_course: str) -> KernelOutcome:
    """A case, run by the reference to its end.

    Raises:
        InfrastructureError: the drives were not armed when control had to start.
    """
    memory = MemoryRecord()
    plant = replace(plant_brief(scenario, network=_NETWORK), traffic=False)
    agents = [agent_brief(scenario, name, network=_NETWORK, bus=()) for name in scenario.names]
    run = InProcessRun(plant, agents, leader_brief(scenario), memory, lambda _: None)
    run.run(stop)
    signals = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
    return KernelOutcome(memory.record(signals, ""), run.stopped_robots, run.events, left_course)


def arming(scenario: Scenario, ticks: Schedule) -> list[Event]:
    """The events of all robots before tick 0.

    Raises:
        InfrastructureError: the drives were not armed when control had to start.
    """
    return [*_armed(_Countdown(scenario, ticks), scenario.names)]


class _Countdown:
    """A scenario, equal to all others whose drives are armed alike."""

    def __init__(self, scenario: Scenario, ticks: Schedule) -> None:
        self.scenario = scenario
        self._key = (
            *(ticks.period_ns, ticks.countdown_ticks),
            *(scenario.drive_choice.parameters, scenario.host),
        )

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Countdown) and self._key == other._key


@lru_cache(maxsize=256)
def _armed(countdown: _Countdown, robots: tuple[str, ...]) -> tuple[Event, ...]:
    """The events of these robots up to tick 0."""
    events = _armed_alone(countdown)
    return tuple(event._replace(source=robot) for robot in robots for event in events)


@lru_cache(maxsize=256)
def _armed_alone(countdown: _Countdown) -> tuple[Event, ...]:
    """The events of one robot up to tick 0."""
    scenario = countdown.scenario
    plant = plant_brief(scenario, network=_NETWORK)
    agent = agent_brief(scenario, scenario.names[0], network=_NETWORK, bus=())
    alone = replace(agent, hears=(), channels=(), signals=CONTROLLER_SIGNALS, logs_inputs=False)
    run = InProcessRun(
        replace(plant, robots=plant.robots[:1], traffic=False),
        [alone],
        leader_brief(scenario),
        MemoryRecord(),
        lambda _: None,
    )
    run.run(Stop(), last_tick=0)
    return tuple(event for event in run.events if event.tick < 0)
