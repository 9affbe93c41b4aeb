"""A bus of any interface in frames, as the loops of a controller read and write it.

BusClient      an emulated bus: packets of frames, below python-can's messages
MessageBus     any other interface, or filters that are python-can's: message by message
"""

from collections.abc import Sequence
from typing import Protocol

import can

from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.pythoncan import can_id_of, to_message
from bridge.frame import Frame


class FrameBus(Protocol):
    """What a controller in real time needs of its bus."""

    def receive_frames(self, timeout_s: float) -> Sequence[Frame] | None:
        """The next frames; None if none came within a time [s]; 0 polls.

        Raises:
            can.CanError, OSError: the interface failed.
        """

    def send(self, frame: Frame) -> None:
        """Send one frame, which may leave with the next wait for frames.

        Raises:
            can.CanError, OSError: it was not sent.
        """


class MessageBus:
    """A python-can bus of any interface, in frames.

    Args:
        bus: open; the caller closes it.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def receive_frames(self, timeout_s: float) -> Sequence[Frame] | None:
        """The frame of the next message."""
        message = self._bus.recv(timeout_s)
        return None if message is None else (Frame(can_id_of(message), bytes(message.data)),)

    def send(self, frame: Frame) -> None:
        """Send one frame as a message."""
        self._bus.send(to_message(frame.can_id, frame.data))


def in_frames(bus: can.BusABC) -> FrameBus:
    """An open bus in frames, by the shortest way that keeps its filters."""
    if isinstance(bus, FleetloopBus) and not bus.filters:
        return bus.client
    return MessageBus(bus)
