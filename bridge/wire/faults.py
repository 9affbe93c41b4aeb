"""Fault injection on a wire: frames are dropped, duplicated, delayed or corrupted.

    what        where                                  effect
    DROP        between a node and its controller      the frame is taken and never sent
    DUPLICATE   the same                               the frame is queued twice
    DELAY       the same                               the frame is queued later
    CORRUPT     on the wire                            a bit is flipped: error frame, sent again

A fault applies to the next `count` frames that match it, or to all until faults are cleared.
"""

from dataclasses import dataclass
from enum import Enum, auto

from bridge.frame import Frame


class FaultKind(Enum):
    """Effect of a fault on a frame."""

    DROP = auto()
    DUPLICATE = auto()
    DELAY = auto()
    CORRUPT = auto()


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault: its kind, the frames that it applies to, and how often."""

    kind: FaultKind
    can_id: int | None = None  # SocketCAN's, with flags; None: any
    node: str | None = None  # sender; None: any
    count: int | None = 1  # None: until cleared
    delay_ns: int = 0

    def __post_init__(self) -> None:
        if self.count is not None and self.count < 1:
            raise ValueError(f"count = {self.count}: 1 or more frames, or None for all")
        if (self.delay_ns > 0) != (self.kind is FaultKind.DELAY):
            raise ValueError(f"delay_ns = {self.delay_ns}: above 0 for a delay, 0 for the others")


class Faults:
    """The faults of one wire that are still to be applied, oldest first."""

    __slots__ = ("_left",)

    def __init__(self) -> None:
        self._left: list[tuple[Fault, int | None]] = []

    def add(self, fault: Fault) -> None:
        """Apply this fault from now on."""
        self._left.append((fault, fault.count))

    def clear(self) -> None:
        """Forget all faults."""
        self._left.clear()

    def __bool__(self) -> bool:
        return bool(self._left)

    def match(self, sender: str, frame: Frame, *, on_wire: bool) -> Fault | None:
        """The oldest fault that applies to a frame; None: no fault does."""
        for fault, _ in self._left:
            if (
                (fault.kind is FaultKind.CORRUPT) is on_wire
                and fault.can_id in (None, frame.can_id)
                and fault.node in (None, sender)
            ):
                return fault
        return None

    def applied(self, fault: Fault) -> None:
        """A fault was applied: one application less is left."""
        for n, (other, left) in enumerate(self._left):
            if other is fault:
                if left == 1:
                    del self._left[n]
                elif left is not None:
                    self._left[n] = (fault, left - 1)
                return
