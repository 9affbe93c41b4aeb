"""Frames on a bus with bit timing: when they ended, and whose they were."""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Generic, NamedTuple, TypeVar

from bridge.frame import ERR, Frame

TURN = 1024
"""Frames that others than controllers get onto a bus at a time."""
Key = str | int
"""A client of a bus: the name of the robot that it controls in lockstep, else a number."""


_NOBODY: Mapping[Key, Frame] = {}


class Stamped(NamedTuple):
    """A frame and the bus time at which it ended."""

    end_ns: int
    frame: Frame


class Said(NamedTuple):
    """A frame that a client wants to send."""

    key: Key
    frame: Frame


class Passed(NamedTuple):
    """A frame that ended on the bus; the key of the client that had sent it, None for a drive.

    An error frame is what a client's node tells it: `apart` has those of the nodes, `frame` is for
    clients without one. With `to` it concerns one client only.
    """

    end_ns: int
    frame: Frame
    key: Key | None = None
    to: Key | None = None
    apart: Mapping[Key, Frame] = _NOBODY

    @property
    def of_drive(self) -> bool:
        """Whether it is a frame that a drive sent."""
        return self.key is None and not self.frame.can_id & ERR

    def heard_by(self, key: Key) -> bool:
        """Whether a client hears it from the bus; its own frames it doesn't."""
        return key != self.key and self.to in (None, key)

    def as_heard_by(self, key: Key) -> Stamped:
        """What it hears, and when that ended."""
        return Stamped(self.end_ns, self.apart.get(key, self.frame) if self.apart else self.frame)


_Item = TypeVar("_Item")


class Spoken(Generic[_Item]):
    """What the clients of a bus sent and nobody has taken yet, in order.

    What a controller says in lockstep is taken at once. The others get `TURN` frames through at a
    time, so that who says very much makes nobody wait: no bus carries more in a tick.
    """

    __slots__ = ("_late", "now")

    def __init__(self) -> None:
        self.now: list[_Item] = []  # what will be taken next
        self._late: deque[_Item] = deque()

    def __len__(self) -> int:
        return len(self.now) + len(self._late)

    def put(self, items: Iterable[_Item], *, at_once: bool) -> None:
        """Add what a client said."""
        if at_once or (len(self.now) < TURN and not self._late):
            self.now += items
        else:
            self._late.extend(items)

    def take(self) -> list[_Item]:
        """What is next to take."""
        now, self.now = self.now, []
        if late := self._late:
            self.now = [late.popleft() for _ in range(min(TURN, len(late)))]
        return now
