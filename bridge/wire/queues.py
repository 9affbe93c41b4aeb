"""Transmit queues of a node.

    queue       of                   next on the bus        when full
    Fifo        a host: SocketCAN's  the oldest             refused: the caller gets ENOBUFS
                `txqueuelen` of 10
    Mailboxes   a drive: bxCAN's     the lowest             refused: firmware tries again a
                three                identifier             millisecond later with newer data

Nothing pending is ever replaced by something newer: ODrive's firmware 0.5.6 looks for a free
mailbox and else reports that it didn't send (`ODriveCAN::send_message`), and its mailboxes compete
by identifier (`TransmitFifoPriority = DISABLE`). Of equal identifiers the older one goes first. The
frame that is on the wire keeps its place until it was sent, for it may have to be sent again.
"""

from abc import ABC, abstractmethod
from bisect import insort
from typing import Final

from bridge.frame import Frame

HOST_QUEUE: Final = 10
DRIVE_MAILBOXES: Final = 3
ERROR_KEY: Final = -1
"""Key of an injected error flag: it takes part in no arbitration, it ends one."""


class Entry:
    """A pending frame; entries compare as the bus and then the queue would choose."""

    __slots__ = ("bits", "frame", "key", "number")

    def __init__(self, key: int, number: int, frame: Frame, bits: int) -> None:
        self.key = key  # of arbitration, see `bits.arbitration_key`
        self.number = number  # in order of submission, unique on the wire
        self.frame = frame
        self.bits = bits  # on the wire, see `bits.frame_bits`

    def __lt__(self, other: "Entry") -> bool:
        if self.key != other.key:
            return self.key < other.key
        return self.number < other.number


class Queue(ABC):
    """A transmit queue; `entries` are in the order in which they go to arbitration."""

    __slots__ = ("capacity", "entries")

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"a transmit queue for {capacity} frames: it takes 1 or more")
        self.capacity = capacity
        self.entries: list[Entry] = []

    def push(self, entry: Entry) -> bool:
        """Take a frame, or return False: no room."""
        if len(self.entries) >= self.capacity:
            return False
        self.put(entry)
        return True

    @abstractmethod
    def put(self, entry: Entry) -> None:
        """Take a frame, room or not, where it belongs."""

    def sent(self, entry: Entry) -> None:
        """Forget a frame that was sent."""
        self.entries.remove(entry)

    def clear(self) -> int:
        """Forget all; return how many frames that were submitted are lost."""
        count = len(self.entries)
        self.entries.clear()
        return count


class Fifo(Queue):
    """First in, first out: an urgent frame waits behind the others of its own node."""

    __slots__ = ()

    def __init__(self, capacity: int = HOST_QUEUE) -> None:
        super().__init__(capacity)

    def put(self, entry: Entry) -> None:
        """Take a frame behind all others."""
        self.entries.append(entry)


class Mailboxes(Queue):
    """A controller's transmit mailboxes: the lowest identifier goes first."""

    __slots__ = ()

    def __init__(self, capacity: int = DRIVE_MAILBOXES) -> None:
        super().__init__(capacity)

    def put(self, entry: Entry) -> None:
        """Take a frame by its identifier."""
        insort(self.entries, entry)
