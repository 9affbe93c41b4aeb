"""The port of a bus whose clients are in other processes."""

from collections.abc import Sequence

from bridge.can_bus.drive_port import DrivePort
from bridge.can_bus.hub import Hub
from bridge.can_bus.packet import Key, Submitted, Transmitted
from bridge.frame import Frame
from plant.bus.port import Port


class SocketPort(Port):
    """One bus by name: frames over the drives' end of all buses, bit timing over the hub."""

    __slots__ = ("_end", "_hub", "_name")

    def __init__(self, name: str, end: DrivePort, hub: Hub) -> None:
        self._name = name
        self._end = end
        self._hub = hub

    def deliver(self, stamp_ns: int, frames: list[Frame]) -> None:
        """Send frames of the drives to all clients."""
        self._end.deliver(self._name, stamp_ns, frames)

    def receive(self) -> list[Frame]:
        """The frames that clients sent since the last call."""
        return self._end.receive(self._name)

    def forward(self, stamp_ns: int, ended: Sequence[Transmitted], asked: str | None) -> None:
        """Tell all clients what ended on the wire."""
        self._hub.forward(self._name, stamp_ns, ended, asked)

    def submitted(self) -> list[Submitted]:
        """The frames that clients submitted to their transmit queues since the last call."""
        return self._hub.submitted(self._name)

    def departed(self) -> list[Key]:
        """Clients that left since the last call."""
        return self._hub.departed(self._name)

    def return_credit(self, key: Key, count: int) -> None:
        """Frames of a client have left its transmit queue."""
        self._hub.return_credit(self._name, key, count)
