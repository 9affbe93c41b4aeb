"""A bus of a lockstep run on its way through the ticks."""

from configs.edges import FOREVER
from plant.bus.port import ALL, Bus


class Lane:
    """One bus between its questions and answers."""

    __slots__ = (
        *("absent", "asked", "asked_ns", "awaits", "bus", "done", "due_tick", "name", "robots"),
        *("steps", "tick"),
    )

    def __init__(self, name: str, bus: Bus, tick: int) -> None:
        self.name = name
        self.bus = bus
        self.steps = bus.steps()
        self.robots = [robot.brief.robot for robot in bus.robots]
        self.tick = tick
        self.asked = ALL
        self.asked_ns = 0  # when it was asked to answer; 0: it is not asked
        self.done = False
        self.absent = False  # whether a controller of it is
        self.due_tick = FOREVER  # from which on absences have to be looked at
        self.awaits: list[str] = []  # robots whose controllers have to be on it for its next tick
