"""Outcome of a transmission: success, or an error frame, at which bit and why.

In order, the first that applies:

    an injected error flag                        see below
    a sender at the wrong bit rate                bit error after the arbitration field; all fail
    an active listener at the wrong bit rate      the same as a stuff error, and it was the first
    senders of one identifier, different bits     at the first bit that differs, recessive senders
                                                  see a bit error: an active one destroys the frame
                                                  for all, passive ones drop out, the rest go on
    a fault that corrupts it                      form error at the delimiter of the CRC
    no other node to acknowledge it               acknowledge error after the acknowledge slot
    else                                          it passes

An injected error flag is six dominant bits in a row, at once whatever is on the wire. In a frame
that is under way it destroys it from the next bit on. At its start it destroys it at the first
recessive bit of the frame that starts with it. On an idle wire all others see it as a stuff error
after the sixth bit. The injecting node counts nothing.

An error frame is the error flag, 6 bits, longer when others notice only by it (they see six
dominant bits in a row and then send their own: 12 at most), and a delimiter of 8 bits.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

from bridge.frame import EFF
from bridge.frame_faults import ActingFrameFault, FrameFaults
from bridge.wire.bits import (
    END_BITS,
    ERROR_DELIMITER_BITS,
    ERROR_FLAG_BITS,
    ERROR_FRAME_BITS,
    INTERMISSION_BITS,
    LONGEST_ERROR_FLAG_BITS,
    stuffed_bits,
)
from bridge.wire.confinement import NodeState
from bridge.wire.node import ErrorKind, Node
from bridge.wire.queues import ERROR_KEY, Entry

_SECOND_NS: Final = 1_000_000_000
_ARBITRATION_BITS: Final = 13
_ARBITRATION_BITS_EXTENDED: Final = 33
_AFTER_ACKNOWLEDGE: Final = 1 + END_BITS + INTERMISSION_BITS


class Sending(NamedTuple):
    """A node and the frame that it is sending."""

    node: Node
    entry: Entry


class Outcome(NamedTuple):
    """Outcome of a transmission; bits count from its start."""

    senders: Sequence[Sending]  # of all its bits, or until it is destroyed
    bits: int  # until the wire is free again
    error: ErrorKind | None = None
    error_bit: int = 0  # where the error flag begins
    fallen: Sequence[Sending] = ()  # passive senders that saw a bit error and dropped out
    first: Node | None = None  # a listener that destroyed it
    fault: ActingFrameFault | None = None
    orders: Sequence[Sending] = ()  # injected error flags that destroyed it


class Plan:
    """A transmission, its senders, times and outcome `what`; None: success."""

    __slots__ = ("done_ns", "entry", "free_ns", "heard_by", "sender", "start_ns", "what")

    def __init__(
        self, sender: Node, entry: Entry, start_ns: int, what: Outcome | None, bit_rate: int
    ) -> None:
        self.sender = sender
        self.entry = entry
        self.start_ns = start_ns
        self.what = what
        bits = entry.bits if what is None else what.bits
        done = bits - INTERMISSION_BITS
        if what is not None and what.error is not None:
            done = what.error_bit
        self.done_ns = start_ns + done * _SECOND_NS // bit_rate
        self.free_ns = start_ns + bits * _SECOND_NS // bit_rate
        self.heard_by: tuple[Node, ...] = ()

    def carries(self, entry: Entry) -> bool:
        """Whether a frame is sent in it."""
        if self.what is None:
            return entry is self.entry
        what = self.what
        return any(s.entry is entry for s in (*what.senders, *what.fallen, *what.orders))

    def involves(self, node: Node) -> bool:
        """Whether a node is sending in it."""
        if self.what is None:
            return node is self.sender
        what = self.what
        return any(s.node is node for s in (*what.senders, *what.fallen, *what.orders))


def tied(waiting: Sequence[Sending], winner: Entry) -> list[Sending]:
    """All that send the winning arbitration field, in their order."""
    return [sending for sending in waiting if sending.entry.key == winner.key]


def ordered(waiting: Sequence[Sending]) -> Outcome:
    """Outcome of injected error flags, and of the frame that would have started with them."""
    orders = [sending for sending in waiting if sending.entry.key == ERROR_KEY]
    others = [sending for sending in waiting if sending.entry.key != ERROR_KEY]
    starting: Sequence[Sending] = ()
    at = ERROR_FLAG_BITS
    if others:
        starting = tied(others, min(sending.entry for sending in others))
        at = stuffed_bits(starting[0].entry.frame).index("1") + 1
    return Outcome(starting, ERROR_FRAME_BITS, ErrorKind.STUFF, at, orders=orders)


def cut_short(plan: Plan, order: Sending, bit: int) -> Outcome:
    """Outcome of a transmission under way that an error flag destroys from `bit` on."""
    before = plan.what
    senders: Sequence[Sending] = (Sending(plan.sender, plan.entry),)
    if before is None:
        before = Outcome(senders, plan.entry.bits)
    return before._replace(
        bits=bit + ERROR_FRAME_BITS,
        error=ErrorKind.STUFF,
        error_bit=bit,
        first=None,
        fault=None,
        orders=(*before.orders, order),
    )


def outcome(senders: Sequence[Sending], nodes: Sequence[Node], faults: FrameFaults) -> Outcome:
    """Outcome of the frame of `senders`, the winners of the arbitration, among all `nodes`."""
    frame = senders[0].entry.frame
    listeners = [node for node in nodes if node.state is not NodeState.BUS_OFF]
    sending = [sender.node for sender in senders]
    after = _ARBITRATION_BITS_EXTENDED if frame.can_id & EFF else _ARBITRATION_BITS
    if any(node.wrong_bit_rate for node in sending):
        return _destroyed(senders, ErrorKind.BIT, after, LONGEST_ERROR_FLAG_BITS)
    for node in listeners:
        if node.wrong_bit_rate and node.state is not NodeState.ERROR_PASSIVE:
            found = _destroyed(senders, ErrorKind.STUFF, after, LONGEST_ERROR_FLAG_BITS)
            return found._replace(first=node)
    fallen: list[Sending] = []
    if len(senders) > 1:
        clash = _clash(senders, fallen)
        if clash is not None:
            return clash
        senders = [sender for sender in senders if sender not in fallen]
    sender, entry = senders[0]
    fault = faults.match(entry.frame, of_drive=sender.of_drive, on_wire=True)
    if fault is not None:
        at = entry.bits - _AFTER_ACKNOWLEDGE - 1
        found = _destroyed(senders, ErrorKind.FORM, at, ERROR_FLAG_BITS)
        return found._replace(fallen=fallen, fault=fault)
    if not any(node not in sending and not node.wrong_bit_rate for node in listeners):
        at = entry.bits - _AFTER_ACKNOWLEDGE
        found = _destroyed(senders, ErrorKind.ACK, at, ERROR_FLAG_BITS)
        return found._replace(fallen=fallen)
    return Outcome(senders, entry.bits, fallen=fallen)


def _clash(senders: Sequence[Sending], fallen: list[Sending]) -> Outcome | None:
    """The error of senders whose bits differ; passive ones that can't destroy it are `fallen`."""
    streams = {sender.node: stuffed_bits(sender.entry.frame) for sender in senders}
    going = list(senders)
    while len({streams[sender.node] for sender in going}) > 1:
        texts = [streams[sender.node] for sender in going]
        at = next(n for n, bits in enumerate(zip(*texts, strict=False)) if len(set(bits)) > 1)
        seeing = [sender for sender, text in zip(going, texts, strict=True) if text[at] == "1"]
        if any(sender.node.state is not NodeState.ERROR_PASSIVE for sender in seeing):
            wire = next(text for text in texts if text[at] == "0")[: at + 1]
            dominant = len(wire) - len(wire.rstrip("0"))
            flag = LONGEST_ERROR_FLAG_BITS - dominant
            found = _destroyed(going, ErrorKind.BIT, at + 1, flag)
            return found._replace(fallen=fallen)
        fallen += seeing
        going = [sender for sender in going if sender not in seeing]
    return None


def _destroyed(senders: Sequence[Sending], kind: ErrorKind, at: int, flag: int) -> Outcome:
    return Outcome(senders, at + flag + ERROR_DELIMITER_BITS + INTERMISSION_BITS, kind, at)
