"""Rate, load and nodes of a bus, counted over a time.

    frame rate = frames / T     load = Σ bits / (T · bit rate)     T: bus time that passed [s]

Bits are counted exactly, stuff bits included; an error frame counts as 20 (ISO 11898-1: 17 to 23).
Bus time is the scenario's: in lockstep it passes faster or slower than the wall's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from bridge.drives.interface import DriveProtocol
from bridge.frame import ERR, Frame
from bridge.wire.bits import frame_bits
from fleetloop.can.decoder import protocol_of

ERROR_FRAME_BITS = 20


@dataclass(frozen=True, slots=True)
class Node:
    """A node of a drive protocol; `state` and `errors` are empty until a frame says them."""

    node: int
    state: str
    errors: str


@dataclass(slots=True)
class Census:
    """Counts the frames of one bus."""

    bit_rate: int
    drives: DriveProtocol = field(default_factory=protocol_of)
    """The protocol whose nodes are counted."""
    frames: int = 0
    error_frames: int = 0
    other_frames: int = 0  # of other protocols
    _bits: int = 0
    _first_ns: int = -1
    _last_ns: int = -1
    _bits_of_first: int = 0
    _frames_of_first: int = 0
    _nodes: dict[int, Node] = field(default_factory=dict)

    def count(self, frame: Frame, stamp_ns: int) -> None:
        """Take one frame."""
        bits = ERROR_FRAME_BITS if frame.can_id & ERR else frame_bits(frame)
        self.frames += 1
        self._bits += bits
        if self._first_ns in (-1, stamp_ns):
            # The first instant only starts the clock: what came at it took time before.
            self._first_ns = stamp_ns
            self._frames_of_first += 1
            self._bits_of_first += bits
        self._last_ns = max(self._last_ns, stamp_ns)
        if frame.can_id & ERR:
            self.error_frames += 1
        elif (seen := self.drives.node_seen(frame)) is None:
            self.other_frames += 1
        elif seen.state or seen.node not in self._nodes:
            self._nodes[seen.node] = Node(*seen)

    @property
    def seconds(self) -> float:
        """Bus time between the first and the last frame."""
        return (self._last_ns - self._first_ns) / 1e9

    @property
    def bus_time_s(self) -> float | None:
        """Bus time of the last frame; None: there was none."""
        return None if self._last_ns < 0 else self._last_ns / 1e9

    @property
    def rate(self) -> float | None:
        """Frames per second of bus time; None: bus time did not pass."""
        return (self.frames - self._frames_of_first) / self.seconds if self.seconds > 0 else None

    @property
    def load(self) -> float | None:
        """Share of the bus's time that frames took, 0..1 and above; None: bus time did not pass."""
        if self.seconds <= 0:
            return None
        return (self._bits - self._bits_of_first) / (self.seconds * self.bit_rate)

    @property
    def nodes(self) -> Sequence[Node]:
        """Nodes that sent frames or were sent some, by number."""
        return [self._nodes[number] for number in sorted(self._nodes)]
