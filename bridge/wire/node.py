"""A node of an emulated wire, and what the wire reports."""

from enum import Enum
from typing import NamedTuple

from bridge.frame import Frame
from bridge.wire.confinement import Confinement, NodeState
from bridge.wire.queues import Queue


class ErrorKind(Enum):
    """What the first node that complained saw (ISO 11898-1)."""

    BIT = "another bit on the wire than the one sent"
    STUFF = "six equal bits in a row"
    FORM = "a dominant bit where the format has a recessive one"
    ACK = "nobody acknowledged"


class Counters:
    """What became of the frames of one node; accepted = sent + dropped + queued + withheld."""

    __slots__ = ("accepted", "dropped", "errors", "refused", "sent")

    def __init__(self) -> None:
        self.accepted = 0  # taken by `submit`, a duplicate counts as well
        self.refused = 0  # not taken: no room, or off the bus
        self.sent = 0
        self.dropped = 0  # lost with a node that left or went off the bus, or by a disturbance
        self.errors = 0  # attempts to send that failed


class Node:
    """One controller on the wire; made by `Wire.attach`, to be read only by others."""

    __slots__ = (
        "attached",
        "confinement",
        "counters",
        "name",
        "not_before_ns",
        "queue",
        "recessive_from_ns",
        "restart_ns",
        "sequences_left",
        "state",
        "wrong_bit_rate",
    )

    def __init__(
        self, name: str, queue: Queue, *, restart_ns: int | None, wrong_bit_rate: bool
    ) -> None:
        self.name = name
        self.queue = queue
        self.restart_ns = restart_ns
        self.wrong_bit_rate = wrong_bit_rate
        self.confinement = Confinement()
        self.state = NodeState.ERROR_ACTIVE
        self.counters = Counters()
        self.attached = True
        self.not_before_ns = 0  # end of its suspended transmission
        self.recessive_from_ns = 0  # while it comes back from bus-off: since when it counts ...
        self.sequences_left = 0  # ... and how many sequences of 11 recessive bits are left

    def __repr__(self) -> str:
        return f"Node({self.name!r})"


class Delivered(NamedTuple):
    """A frame has passed: the last bit of its end of frame was at `end_ns`."""

    end_ns: int
    start_ns: int
    sender: Node
    frame: Frame
    heard_by: tuple[Node, ...]  # in order of attachment, the senders not among them
    merged: tuple[Node, ...] = ()  # others that sent the same bits at the same time


class ErrorFrame(NamedTuple):
    """A frame was destroyed: the error flag began at `at_ns`, the wire is free at `free_ns`.

    The senders send it again as soon as they may. An error flag that was ordered on an idle wire
    has no senders.
    """

    at_ns: int
    start_ns: int
    free_ns: int
    kind: ErrorKind
    senders: tuple[Node, ...]
    frame: Frame  # of the first sender; without any the error frame that was ordered
    ordered_by: tuple[Node, ...] = ()  # who signalled it because they were told to


class StateChanged(NamedTuple):
    """A node is trusted more or less than before."""

    at_ns: int
    node: Node
    state: NodeState


Event = Delivered | ErrorFrame | StateChanged
