"""Troubles of the plant: of buses, of frames on them, and of bodies whose motion diverged."""

from collections.abc import Iterable, Mapping

from bridge.process.awake import Stall
from configs.events import Event, when
from configs.roles import PLANT
from plant.robot import EmulatedRobot


def bus_troubles(troubles: Mapping[str, str], robots: Iterable[EmulatedRobot]) -> dict[str, str]:
    """The troubles of buses, and the frames on them that drives ignored."""
    found = {bus: [text] for bus, text in troubles.items()}
    for robot in robots:
        for side, drive in zip(("right", "left"), robot.drives, strict=True):
            if count := drive.ignored:
                text = f"{robot.brief.robot}'s {side} drive ignored {count} frames: no such command"
                found.setdefault(robot.brief.bus, []).append(f"{text}, value or length")
    return {bus: "; ".join(texts) for bus, texts in found.items()}


def trouble_events(tick: int, troubles: Mapping[str, str]) -> dict[str, Event]:
    """An event of each bus in trouble, as it is at a tick."""
    return {
        f"bus {bus}": Event(tick, f"bus/{bus}", "bus_trouble", text)
        for bus, text in troubles.items()
    }


def stall_events(stalls: Iterable[Stall]) -> dict[str, Event]:
    """An event of each stall of the plant."""
    text = "the plant, or its machine, stalled for {:.2f} s"
    return {
        f"stall {one.tick}": Event(one.tick, PLANT.name, "stalled", text.format(one.lasted_s))
        for one in stalls
    }


def divergences(robots: Iterable[EmulatedRobot], period_ns: int) -> dict[str, Event]:
    """The robots whose motion diverged, and the event, at the tick that did it."""
    return {
        robot.brief.robot: Event(
            round(found.t_s * 1e9) // period_ns, robot.brief.robot, "diverged", str(found)
        )
        for robot in robots
        if (found := robot.divergence) is not None
    }


def diverged_robots(robots: Iterable[EmulatedRobot], period_ns: int) -> dict[str, str]:
    """Robots whose motion diverged: the tick that did it, and how."""
    return {
        robot: f"{when(event.tick, period_ns)}: {event.text}"
        for robot, event in divergences(robots, period_ns).items()
    }
