"""Disturbances on order: which frames of a wire get lost, come twice, come late or are destroyed.

    what        where                                  effect
    DROP        between a node and its controller      the frame is taken and never sent
    DUPLICATE   the same                               the frame is queued twice
    DELAY       the same                               the frame is queued later
    CORRUPT     on the wire                            a bit is flipped: error frame, sent again

A disturbance strikes the next `count` frames that match, or all until the rules are cleared.
"""

from dataclasses import dataclass
from enum import Enum, auto

from bridge.frame import Frame


class Kind(Enum):
    """What happens to a frame."""

    DROP = auto()
    DUPLICATE = auto()
    DELAY = auto()
    CORRUPT = auto()


@dataclass(frozen=True, slots=True)
class Disturbance:
    """What shall happen to which frames, and how often."""

    kind: Kind
    can_id: int | None = None  # SocketCAN's, with flags; None: any
    node: str | None = None  # sender; None: any
    count: int | None = 1  # None: until cleared
    delay_ns: int = 0

    def __post_init__(self) -> None:
        if self.count is not None and self.count < 1:
            raise ValueError(f"count = {self.count}: 1 or more frames, or None for all")
        if (self.delay_ns > 0) != (self.kind is Kind.DELAY):
            raise ValueError(f"delay_ns = {self.delay_ns}: above 0 for a delay, 0 for the others")


class Disturbances:
    """The disturbances of one wire that have not struck in full yet, oldest first."""

    __slots__ = ("_left",)

    def __init__(self) -> None:
        self._left: list[tuple[Disturbance, int | None]] = []

    def add(self, disturbance: Disturbance) -> None:
        """Let this happen from now on."""
        self._left.append((disturbance, disturbance.count))

    def clear(self) -> None:
        """Let nothing more happen."""
        self._left.clear()

    def __bool__(self) -> bool:
        return bool(self._left)

    def match(self, sender: str, frame: Frame, *, on_wire: bool) -> Disturbance | None:
        """What would happen to this frame, if anything."""
        for disturbance, _ in self._left:
            if (
                (disturbance.kind is Kind.CORRUPT) is on_wire
                and disturbance.can_id in (None, frame.can_id)
                and disturbance.node in (None, sender)
            ):
                return disturbance
        return None

    def struck(self, disturbance: Disturbance) -> None:
        """It happened: once less to come."""
        for n, (other, left) in enumerate(self._left):
            if other is disturbance:
                if left == 1:
                    del self._left[n]
                elif left is not None:
                    self._left[n] = (disturbance, left - 1)
                return
