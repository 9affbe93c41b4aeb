"""A whole run in this process, its record in memory: no file, no traffic log."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from bridge.network.messages import Progress
from bridge.process.lifecycle import Stop
from configs.connections import NetworkLink
from configs.events import Event
from configs.resolve import agent_brief, leader_brief, plant_brief, signals_of
from configs.scenario import Scenario
from fleetloop.in_process.run import InProcessRun
from fleetloop.record.memory import MemoryRecord
from fleetloop.record.reader import Record

_NETWORK = NetworkLink("in-process", "", "", "")


class Outcome(NamedTuple):
    """What a run came to."""

    record: Record
    stopped: dict[str, str]
    """Robots that stopped themselves or whose motion diverged, and why."""
    events: list[Event]
    left_course: str = ""
    """Why another engine left it to this one; "" if none did."""


def run_in_memory(
    scenario: Scenario, stop: Stop, on_progress: Callable[[Progress], None] = lambda _: None
) -> Outcome:
    """Run a scenario from its first tick to its end, or until told to stop.

    One run of many: garbage collection is the caller's (`settled_memory`).

    Raises:
        FleetloopError: what a law or a shape of the user's own did wrong.
    """
    if scenario.bus.record:  # its traffic would only be let go
        bus = replace(scenario.bus, record=())
        scenario = scenario.model_copy(update={"bus": bus})
    memory = MemoryRecord()
    agents = [agent_brief(scenario, name, network=_NETWORK, bus=()) for name in scenario.names]
    plant = plant_brief(scenario, network=_NETWORK)
    run = InProcessRun(
        plant,
        [replace(agent, logs_inputs=False) for agent in agents],
        leader_brief(scenario),
        memory,
        on_progress,
    )
    run.begin()
    run.go(plant.schedule.ticks + 1, stop)
    run.finish()
    signals = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
    return Outcome(memory.record(signals, ""), run.stopped_robots, run.events)
