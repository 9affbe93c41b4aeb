"""A node of an emulated wire, its recovery from bus-off, and the events that a wire reports.

A node that is bus-off recovers after 128 sequences of 11 recessive bits (ISO 11898-1):

    idle wire       every 11 bits are a sequence
    end of a frame  one sequence: delimiter, end of frame, intermission; of an error frame as well
    any frame       ends an incomplete sequence

So recovery takes 1408 bits on an idle wire and 128 frames on a full one.
"""

from enum import Enum
from typing import Final, NamedTuple

from bridge.frame import Frame
from bridge.wire.confinement import (
    ERROR_ACTIVE,
    RECESSIVE_BITS,
    RECOVERY_SEQUENCES,
    Confinement,
    NodeState,
)
from bridge.wire.queues import Queue

NEVER: Final = 1 << 61
"""Bus time at which nothing happens any more."""
_SECOND_NS: Final = 1_000_000_000


class ErrorKind(Enum):
    """Error detected by the first node that signalled one (ISO 11898-1)."""

    BIT = "another bit on the wire than the one sent"
    STUFF = "six equal bits in a row"
    FORM = "a dominant bit where the format has a recessive one"
    ACK = "no node acknowledged"


class NodeCounters:
    """Frames of one node; accepted = sent + dropped + queued + withheld."""

    __slots__ = ("accepted", "dropped", "errors", "refused", "sent")

    def __init__(self) -> None:
        self.accepted = 0  # taken by `submit`, a duplicate counts as well
        self.refused = 0  # not taken: no room, or off the bus
        self.sent = 0
        self.dropped = 0  # lost with a node that left or went off the bus, or by a fault
        self.errors = 0  # attempts to send that failed

    def as_dict(self) -> dict[str, int]:
        """By name."""
        return {
            "accepted": self.accepted,
            "dropped": self.dropped,
            "errors": self.errors,
            "refused": self.refused,
            "sent": self.sent,
        }


class Node:
    """One controller on the wire; made by `Wire.attach`, to be read only by others."""

    __slots__ = (
        "attached",
        "confinement",
        "counters",
        "name",
        "not_before_ns",
        "of_drive",
        "queue",
        "recessive_from_ns",
        "restart_ns",
        "sequences_left",
        "state",
        "wrong_bit_rate",
    )

    def __init__(
        self,
        name: str,
        queue: Queue,
        *,
        restart_ns: int | None,
        wrong_bit_rate: bool,
        of_drive: bool,
    ) -> None:
        self.name = name
        self.queue = queue
        self.of_drive = of_drive
        self.restart_ns = restart_ns
        self.wrong_bit_rate = wrong_bit_rate
        self.confinement = Confinement()
        self.state: NodeState = ERROR_ACTIVE
        self.counters = NodeCounters()
        self.attached = True
        self.not_before_ns = 0  # end of its suspended transmission
        self.recessive_from_ns = 0  # while it comes back from bus-off: since when it counts ...
        self.sequences_left = 0  # ... and how many sequences of 11 recessive bits are left

    def __repr__(self) -> str:
        return f"Node({self.name!r})"


class Babbler:
    """The frame that a node sends again and again."""

    __slots__ = ("frame", "next_ns", "period_ns")

    def __init__(self, first_ns: int, frame: Frame, period_ns: int) -> None:
        self.next_ns = first_ns
        self.frame = frame
        self.period_ns = period_ns


class Recovery:
    """The nodes of a segment that recover from bus-off."""

    __slots__ = ("_bit_rate", "nodes")

    def __init__(self, bit_rate: int) -> None:
        self._bit_rate = bit_rate
        self.nodes: list[Node] = []

    def start(self, node: Node, from_ns: int) -> None:
        """Let a node count from this instant on."""
        node.sequences_left = RECOVERY_SEQUENCES
        node.recessive_from_ns = from_ns
        if node not in self.nodes:
            self.nodes.append(node)

    def back_ns(self, node: Node) -> int:
        """When a node is back if the wire stays idle."""
        return node.recessive_from_ns + self._span(node.sequences_left * RECESSIVE_BITS)

    def next(self, before_ns: int) -> Node | None:
        """The node that is back first, if that is before the next frame begins."""
        if not self.nodes:
            return None
        node = min(self.nodes, key=self.back_ns)
        return node if self.back_ns(node) <= before_ns else None

    def finish(self, node: Node) -> int:
        """A node is back; return when."""
        at_ns = self.back_ns(node)
        self.nodes.remove(node)
        node.sequences_left = 0
        node.confinement.restart()
        return at_ns

    def count(self, start_ns: int, free_ns: int) -> None:
        """A transmission has passed: count what was recessive before it, and begin in its end."""
        span = self._span(RECESSIVE_BITS)
        for node in self.nodes:
            node.sequences_left -= max(0, start_ns - node.recessive_from_ns) // span
            node.recessive_from_ns = max(node.recessive_from_ns, free_ns - span)

    def _span(self, bits: int) -> int:
        return bits * _SECOND_NS // self._bit_rate


class Delivered:
    """A frame was transmitted: the last bit of its end of frame was at `end_ns`."""

    __slots__ = ("end_ns", "frame", "heard_by", "merged", "sender", "start_ns")

    def __init__(
        self,
        end_ns: int,
        start_ns: int,
        sender: Node,
        frame: Frame,
        heard_by: tuple[Node, ...],
        merged: tuple[Node, ...] = (),
    ) -> None:
        self.end_ns = end_ns
        self.start_ns = start_ns
        self.sender = sender
        self.frame = frame
        self.heard_by = heard_by  # in order of attachment, the senders not among them
        self.merged = merged  # others that sent the same bits at the same time

    def __repr__(self) -> str:
        heard = f"{self.sender} from {self.start_ns} to {self.end_ns} ns, heard by {self.heard_by}"
        return f"{self.frame} of {heard}, the same as that of {self.merged}"


class ErrorFrame(NamedTuple):
    """A frame was destroyed: the error flag began at `at_ns`, the wire is free at `free_ns`.

    The senders send it again as soon as they may. An error flag that was injected on an idle wire
    has no senders.
    """

    at_ns: int
    start_ns: int
    free_ns: int
    kind: ErrorKind
    senders: tuple[Node, ...]
    frame: Frame  # of the first sender; without any the injected error frame
    ordered_by: tuple[Node, ...] = ()  # nodes that injected it


class StateChanged(NamedTuple):
    """The fault confinement state of a node has changed."""

    at_ns: int
    node: Node
    state: NodeState


Event = Delivered | ErrorFrame | StateChanged


def time_of(event: Event) -> int:
    """The bus time at which it happened."""
    return event.end_ns if isinstance(event, Delivered) else event.at_ns
