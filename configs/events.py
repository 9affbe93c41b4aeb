"""Events of a run: what happened at a tick, in a fixed vocabulary and in words.

    source    a robot by its name, "bus/<name>", or a process ("plant", "launcher")
    kind      a key of `KINDS`

An event is exact if scenario and seed determine it: in lockstep its tick, text and place in the
list are the same in every run. Others are about machines, processes and other programs.
"""

from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import NamedTuple

MAX_EVENTS = 512
"""Of one process; later ones are counted."""
MAX_EVENT_TEXT = 500
"""Characters."""


class Event(NamedTuple):
    """One event; ticks below 0 are the countdown."""

    tick: int
    source: str
    kind: str
    text: str = ""


class Gravity(IntEnum):
    """How grave events of a kind are: levels of logs, marks of pages."""

    INFO = 0
    WARNING = 1
    ERROR = 2


class EventKind(NamedTuple):
    """A kind of event."""

    meaning: str
    exact: bool = True
    told: bool = True
    """It is a notice: said while the run goes on, and listed with the results."""
    acted_on: bool = False
    """The launcher acts on it."""
    gravity: Gravity = Gravity.INFO


KINDS: dict[str, EventKind] = {
    "armed": EventKind("both drives of a robot are in closed loop, before tick 0", told=False),
    "drive_error": EventKind(
        "a drive dropped out or fell silent, as the robot's controller saw it",
        told=False,
        gravity=Gravity.WARNING,
    ),
    "stopped": EventKind("a controller took the torque from both wheels", gravity=Gravity.WARNING),
    "rearming": EventKind("a robot that had stopped begins to arm"),
    "rearmed": EventKind("a robot that had stopped drives again"),
    "joined": EventKind("a robot joins the formation late"),
    "rejoined": EventKind("a robot joins the formation again after a restart of its controller"),
    "left": EventKind("a robot leaves the formation, as the scenario has it"),
    "diverged": EventKind("the motion of a body left its bounds", gravity=Gravity.ERROR),
    "law": EventKind("a law recorded a number that isn't finite", gravity=Gravity.ERROR),
    "fault_applied": EventKind("a fault of the scenario, or an ordered one, begins to act"),
    "fault_cleared": EventKind("a fault acts no more"),
    "leader_speed": EventKind("a speed of the virtual leader was ordered", exact=False),
    "bus_trouble": EventKind(
        "a bus failed, or drives ignored frames", exact=False, gravity=Gravity.WARNING
    ),
    "stalled": EventKind(
        "a process, or its machine, stood still", exact=False, gravity=Gravity.WARNING
    ),
    "silent": EventKind("a process shows no sign of life", exact=False, gravity=Gravity.WARNING),
    "cut_off": EventKind(
        "the network to a process, or its machine, went", exact=False, gravity=Gravity.WARNING
    ),
    "killed": EventKind(
        "a fault kills the process of a controller", acted_on=True, gravity=Gravity.WARNING
    ),
    "frozen": EventKind(
        "a fault freezes the process of a controller", acted_on=True, gravity=Gravity.WARNING
    ),
    "held": EventKind(
        "lockstep doesn't wait for a controller until it answers",
        exact=False,
        acted_on=True,
        gravity=Gravity.WARNING,
    ),
    "dropped": EventKind(
        "lockstep doesn't wait for a controller any more",
        exact=False,
        acted_on=True,
        gravity=Gravity.WARNING,
    ),
    "awaited": EventKind(
        "lockstep stands still until a controller is started again",
        exact=False,
        acted_on=True,
        gravity=Gravity.WARNING,
    ),
    "back": EventKind(
        "a process that was silent, cut off, held or dropped is there", exact=False, acted_on=True
    ),
    "restarted": EventKind("a controller's process ended and is started again", exact=False),
}
"""The vocabulary, by name."""


class EventLog:
    """The first `MAX_EVENTS` events of one process, and how many came later."""

    __slots__ = ("kept", "unlisted")

    def __init__(self) -> None:
        self.kept: list[Event] = []
        self.unlisted = 0

    def take(self, event: Event) -> bool:
        """Keep an event if there is room for it; whether it is to be announced."""
        if len(self.kept) < MAX_EVENTS:
            self.kept.append(event)
            return True
        self.unlisted += 1
        return KINDS[event.kind].acted_on

    def remarks(self) -> list[str]:
        """How many events aren't listed, in words."""
        if not self.unlisted:
            return []
        return [f"{self.unlisted} events after the first {MAX_EVENTS} are not listed"]


def when(tick: int, period_ns: int) -> str:
    """A tick in words."""
    return f"tick {tick} (t = {tick * period_ns * 1e-9:.3f} s)"


def told(event: Event, period_ns: int) -> str:
    """An event in words, but for its source."""
    text = f": {event.text}" if event.text else ""
    return f"{when(event.tick, period_ns)}: {event.kind}{text}"


def in_order(events: Iterable[Event], robots: Sequence[str]) -> list[Event]:
    """Events by tick, then by source: robots in their order, then others by name.

    Events of one source at one tick stay in their order.
    """
    ranks = {robot: rank for rank, robot in enumerate(robots)}
    return sorted(events, key=lambda it: (it.tick, ranks.get(it.source, len(ranks)), it.source))
