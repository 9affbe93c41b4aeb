"""The buses of a plant, as its brief wants them: ideal, or with bit timing."""

from collections.abc import Callable, Container, Mapping, Sequence
from random import Random

from bridge.network.telemetry import FrameBuffer
from configs.brief import PlantBrief
from plant.bus.ideal import IdealBus
from plant.bus.port import Begin, Bus, Port
from plant.bus.timed import TimedBus
from plant.faults import BusFaults
from plant.robot import EmulatedRobot

Ports = Callable[[str, Sequence[EmulatedRobot]], Port]
"""The port of a bus, by its name and the robots on it."""
Begins = Callable[[Sequence[EmulatedRobot]], Begin]
"""Callback of each tick, for the robots of a bus."""


def no_begin(_: Sequence[EmulatedRobot]) -> Begin:
    """Nothing is told of ticks: in real time the loop knows them."""
    return lambda _: None


def build_buses(
    brief: PlantBrief,
    robots: Sequence[EmulatedRobot],
    ports: Ports,
    begins: Begins,
    logs: Mapping[str, FrameBuffer],
    external: Container[str] = (),
) -> dict[str, Bus]:
    """All buses by name, with the robots on them in the order of the scenario.

    All frames of a bus go into its one of `logs`, if there is one. `external` buses have no bit
    timing of ours.
    """
    by_bus: dict[str, list[EmulatedRobot]] = {}
    for robot in robots:
        by_bus.setdefault(robot.brief.bus, []).append(robot)
    buses: dict[str, Bus] = {}
    for name, group in by_bus.items():
        port, begin, log = ports(name, group), begins(group), logs.get(name)
        if brief.wire is None or name in external:
            buses[name] = IdealBus(
                group,
                brief.schedule,
                brief.substeps,
                port,
                begin,
                log,
                BusFaults(brief.faults, group, brief.schedule),
            )
        else:
            buses[name] = timed_bus(brief, name, group, port, begin, log)
    return buses


def timed_bus(
    brief: PlantBrief,
    name: str,
    robots: Sequence[EmulatedRobot],
    port: Port,
    begin: Begin,
    log: FrameBuffer | None,
) -> TimedBus:
    """A bus with the bit timing that the brief wants.

    Raises:
        ValueError: it wants none.
    """
    if brief.wire is None:
        raise ValueError(f"bus {name} is ideal")
    random = Random(f"{brief.seed}/{name}/firmware")
    return TimedBus(
        robots,
        brief.schedule,
        brief.wire,
        brief.substeps,
        port=port,
        begin=begin,
        log=log,
        random=random,
        faults=BusFaults(brief.faults, robots, brief.schedule),
    )
