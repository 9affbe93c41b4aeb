"""A node that fails as a babbling idiot."""

from bridge.frame import Frame
from bridge.wire.bits import arbitration_key, frame_bits
from bridge.wire.queues import Entry, Queue


class Endless(Queue):
    """Sends one frame again and again, as fast as the bus lets it."""

    __slots__ = ()

    def __init__(self, frame: Frame) -> None:
        super().__init__(1)
        self.entries.append(Entry(arbitration_key(frame.can_id), -1, frame, frame_bits(frame)))

    def push(self, entry: Entry) -> bool:  # noqa: ARG002
        """No: it says one thing only."""
        return False

    def put(self, entry: Entry) -> None:
        """Not asked for."""

    def sent(self, entry: Entry) -> None:
        """It goes on."""

    def clear(self) -> int:
        """Stop for good; nothing that was submitted is lost."""
        self.entries.clear()
        return 0
