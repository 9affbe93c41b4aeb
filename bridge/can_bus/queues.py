"""What waits at a node to be sent, and what waits there to be read.

    queue       of                   next on the bus        when full
    Fifo        a host: SocketCAN's  the oldest             refused: the caller gets ENOBUFS
                `txqueuelen` of 10
    Mailboxes   a drive: bxCAN's     the lowest             refused: firmware tries again a
                three                identifier             millisecond later with newer data
    Endless     a babbling idiot     always the same frame  never

Nothing pending is ever replaced by something newer: ODrive's firmware 0.5.6 looks for a free mailbox
and else reports that it didn't send (`ODriveCAN::send_message`), and its mailboxes compete by
identifier (`TransmitFifoPriority = DISABLE`). Of equal identifiers the older one goes first. The
frame that is on the wire keeps its place until it was sent, for it may have to be sent again.
"""

from bisect import insort
from collections import deque
from typing import NamedTuple, Protocol

from bridge.frame import Frame

HOST_QUEUE = 10
DRIVE_MAILBOXES = 3
RECEIVE_DEPTH = 3


class Entry(NamedTuple):
    """A pending frame; entries compare as the bus and then the queue would choose."""

    key: int  # of arbitration, see `bits.arbitration_key`
    number: int  # in order of submission, unique on the wire
    frame: Frame


class Queue(Protocol):
    """A transmit queue."""

    def __len__(self) -> int: ...

    def room(self) -> bool:
        """Whether one more frame can wait."""

    def push(self, entry: Entry) -> None:
        """Take a frame; there is room."""

    def head(self) -> Entry:
        """What goes to arbitration; the queue isn't empty."""

    def remove(self, entry: Entry) -> None:
        """Forget a frame that was sent."""

    def clear(self) -> int:
        """Forget all; return how many."""


class Fifo:
    """First in, first out: a high-priority frame waits behind the others of its own node."""

    __slots__ = ("_capacity", "_entries")

    def __init__(self, capacity: int = HOST_QUEUE) -> None:
        if capacity < 1:
            raise ValueError(f"a transmit queue of {capacity} frames: it needs 1 or more")
        self._capacity = capacity
        self._entries: deque[Entry] = deque()

    def __len__(self) -> int:
        return len(self._entries)

    def room(self) -> bool:
        """Whether one more frame can wait."""
        return len(self._entries) < self._capacity

    def push(self, entry: Entry) -> None:
        """Take a frame."""
        self._entries.append(entry)

    def head(self) -> Entry:
        """The oldest."""
        return self._entries[0]

    def remove(self, entry: Entry) -> None:
        """Forget the oldest, which was sent."""
        self._entries.popleft()

    def clear(self) -> int:
        """Forget all; return how many."""
        count = len(self._entries)
        self._entries.clear()
        return count


class Mailboxes:
    """A controller's transmit mailboxes: the lowest identifier goes first."""

    __slots__ = ("_capacity", "_entries")

    def __init__(self, capacity: int = DRIVE_MAILBOXES) -> None:
        if capacity < 1:
            raise ValueError(f"{capacity} transmit mailboxes: a controller needs 1 or more")
        self._capacity = capacity
        self._entries: list[Entry] = []

    def __len__(self) -> int:
        return len(self._entries)

    def room(self) -> bool:
        """Whether a mailbox is free."""
        return len(self._entries) < self._capacity

    def push(self, entry: Entry) -> None:
        """Take a frame into a free mailbox."""
        insort(self._entries, entry)

    def head(self) -> Entry:
        """The lowest identifier."""
        return self._entries[0]

    def remove(self, entry: Entry) -> None:
        """Free the mailbox of a frame that was sent."""
        self._entries.remove(entry)

    def clear(self) -> int:
        """Free all; return how many were taken."""
        count = len(self._entries)
        self._entries.clear()
        return count


class Endless:
    """A babbling idiot: sends one frame again and again, as fast as the bus lets it."""

    __slots__ = ("_entry", "_on")

    def __init__(self, key: int, frame: Frame) -> None:
        self._entry = Entry(key, -1, frame)
        self._on = True

    def __len__(self) -> int:
        return int(self._on)

    def room(self) -> bool:
        """Never: it says one thing only."""
        return False

    def push(self, entry: Entry) -> None:
        """Not called: there is no room."""
        raise ValueError("a babbling node takes no frames")

    def head(self) -> Entry:
        """Always the same."""
        return self._entry

    def remove(self, entry: Entry) -> None:
        """It goes on."""

    def clear(self) -> int:
        """Stop for good; nothing that was submitted is lost."""
        self._on = False
        return 0


class ReceiveFifo:
    """What a controller has received and nobody has read: bxCAN's three, `ReceiveFifoLocked` off.

    When full, the newest frame overwrites the one before it and `overruns` counts the loss.
    """

    __slots__ = ("_depth", "_frames", "overruns")

    def __init__(self, depth: int = RECEIVE_DEPTH) -> None:
        if depth < 1:
            raise ValueError(f"a receive FIFO of {depth} frames: it needs 1 or more")
        self._depth = depth
        self._frames: list[Frame] = []
        self.overruns = 0

    def put(self, frame: Frame) -> None:
        """Take a frame off the bus."""
        if len(self._frames) == self._depth:
            self._frames[-1] = frame
            self.overruns += 1
        else:
            self._frames.append(frame)

    def take(self) -> list[Frame]:
        """Read all, oldest first."""
        frames, self._frames = self._frames, []
        return frames
