"""Interfaces of a bus: its port to the clients, and the methods of every kind of bus.

A bus in lockstep is a generator over its ticks (`Steps`). At a question it gives the port what the
clients hear, and yields the robot that it waits for; when it is resumed it takes from the port what
the clients sent. It yields None when the tick is over. Sockets or calls behind the port change
nothing of what happens on the bus.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from typing import Final, Protocol

from mypy_extensions import mypyc_attr

from bridge.can_bus.packet import Key, Submitted, Transmitted
from bridge.frame import Frame
from plant.faults import BusFaults
from plant.robot import EmulatedRobot

ALL: Final = ""
"""A bus waits for every controller on it; otherwise for the robot of a name."""
Steps = Generator[str | None, None, None]
Begin = Callable[[int], None]
"""Told each tick as it begins, bodies being where they are at that instant."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Port(ABC):
    """The clients of one bus. Ideal buses need the first two methods, timed buses the others."""

    @abstractmethod
    def deliver(self, stamp_ns: int, frames: list[Frame]) -> None:
        """Give frames of the drives, all of one bus time, to all clients."""

    @abstractmethod
    def receive(self) -> list[Frame]:
        """The frames that clients sent since the last call, in order."""

    @abstractmethod
    def forward(self, stamp_ns: int, ended: Sequence[Transmitted], asked: str | None) -> None:
        """Give what ended on the wire until `stamp_ns` to all clients; `asked` has to answer."""

    @abstractmethod
    def submitted(self) -> Sequence[Submitted]:
        """The frames added to the transmit queues of clients since the last call, in order."""

    @abstractmethod
    def departed(self) -> Sequence[Key]:
        """Clients that left since the last call."""

    @abstractmethod
    def return_credit(self, key: Key, count: int) -> None:
        """Frames of a client have left its transmit queue."""


class Bus(Protocol):
    """One bus with the robots on it, in lockstep (`steps`) or in real time (the other methods)."""

    faults: BusFaults
    crossed: int
    """Frames that crossed the bus, drives' and clients'."""
    acts_between_ticks: bool
    """In real time, whether `next_ns` has to be looked at between two ticks."""

    @property
    def robots(self) -> Sequence[EmulatedRobot]:
        """Those on it, in the order of the scenario."""

    @property
    def now_ns(self) -> int:
        """The bus time that it has got to."""

    @property
    def busy_ns(self) -> int | None:
        """Time in which its wire was occupied until then; None: it has no bit timing."""

    def node_counts(self) -> dict[str, dict[str, int]]:
        """Frames of each node on the wire by their fate; nothing without bit timing."""

    def steps(self) -> Steps:
        """The ticks from the first of the countdown to the closing one."""

    def next_ns(self) -> int:
        """The next bus time at which something happens."""

    def react(self, now_ns: int) -> None:
        """Process the clients' frames, and answer."""

    def advance(self, now_ns: int) -> None:
        """Let everything happen that is due until this instant."""

    def move(self, bus_ns: int) -> None:
        """Move the bodies to a tick."""

    def send_due(self, bus_ns: int) -> None:
        """Let the drives send what is due at a tick."""
