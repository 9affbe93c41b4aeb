"""A segment of the wire: arbitration, transmission, and its effects on the nodes.

    free ─ arbitration of all that wait ─► frame ─► end: delivered ─► intermission ─► free
                                             └─► error flag, delimiter ─► intermission ─► free

The next transmission is planned on demand. Until its start it is only a plan: a node that joins the
arbitration before or at that instant voids it. So the segment needs no clock, and gives the same
events however often it is asked.
"""

from typing import Final

from bridge.frame_faults import FrameFaults
from bridge.wire.bits import SUSPEND_BITS
from bridge.wire.confinement import BUS_OFF, ERROR_PASSIVE, OFF
from bridge.wire.node import (
    NEVER,
    Delivered,
    ErrorFrame,
    ErrorKind,
    Event,
    Node,
    Recovery,
    StateChanged,
)
from bridge.wire.outcome import Outcome, Plan, Sending, cut_short, ordered, outcome, tied
from bridge.wire.queues import ERROR_KEY, Entry

_SECOND_NS: Final = 1_000_000_000


class Segment:
    """Nodes connected with each other. Times are handed in, in order."""

    __slots__ = (
        "_acting",
        "_bit_rate",
        "_failing",
        "_faults",
        "_first_ns",
        "_listeners",
        "_moves",
        "_others",
        "_plain",
        "_plan",
        "_ready",
        "_troubled",
        "busy_ns",
        "errors",
        "free_ns",
        "nodes",
        "recovery",
    )

    def __init__(self, bit_rate: int, faults: FrameFaults) -> None:
        self._bit_rate = bit_rate
        self._faults = faults
        self._acting = faults.acting
        self._failing: list[Node] = []  # go bus-off at the end of their frame
        self.nodes: list[Node] = []
        self.free_ns = 0
        self.busy_ns = 0
        self.errors = 0
        self._ready: list[Node] = []  # have something to send
        self._first_ns = NEVER  # earliest start of what is ready
        self._plan: Plan | None = None
        self.recovery = Recovery(bit_rate)
        self._moves: list[tuple[Node, Segment]] = []
        self._troubled = False  # a node has receive errors left to work off
        self._plain = False  # arbitration alone decides, and every frame succeeds
        self._listeners: tuple[Node, ...] = ()
        self._others: dict[Node, tuple[Node, ...]] = {}

    # --- nodes -----------------------------------------------------------------------------------

    def join(self, node: Node, at_ns: int) -> None:
        """Take a node in; it hears from the next frame on."""
        self.nodes.append(node)
        if node.queue.entries:
            self.wake(node, at_ns)
        if node.sequences_left:
            self.recovery.nodes.append(node)
            node.recessive_from_ns = max(node.recessive_from_ns, at_ns)
        self.revise(at_ns)

    def leave(self, node: Node, at_ns: int) -> None:
        """Let a node go; a frame of its own that is on the wire goes on."""
        self.nodes.remove(node)
        self._moves = [move for move in self._moves if move[0] is not node]
        for some in (self._failing, self.recovery.nodes):
            if node in some:
                some.remove(node)
        self._withdraw(node)
        self.revise(at_ns)

    def move(self, node: Node, to: "Segment", at_ns: int) -> None:
        """Take a node to another segment; if it is sending, at the end of its frame."""
        self._moves = [move for move in self._moves if move[0] is not node]
        if self.is_sending(node, at_ns) and to is not self:
            self._moves.append((node, to))
        elif to is not self:
            self.leave(node, at_ns)
            to.join(node, at_ns)

    def discard(self, node: Node, at_ns: int) -> int:
        """Drop what a node has queued, less its frame on the wire; return how many frames."""
        plan = self._plan if self.is_sending(node, at_ns) else None
        entries = node.queue.entries
        kept = [entry for entry in entries if plan is not None and plan.carries(entry)]
        dropped = len(entries) - len(kept)
        entries[:] = kept
        if not kept:
            self._withdraw(node)
        self.revise(at_ns)
        return dropped

    def fail(self, node: Node, at_ns: int, events: list[Event]) -> None:
        """Let a node go bus-off; if it is sending, at the end of its frame."""
        if self.is_sending(node, at_ns):
            self._failing.append(node)
            return
        node.confinement.tec = OFF
        self._report_state(node, at_ns, events)
        self._withdraw(node)

    def awaits(self, segment: "Segment") -> bool:
        """Whether a node is about to move to that segment."""
        return any(to is segment for _, to in self._moves)

    def deserted(self) -> bool:
        """Whether it has no nodes, and no frame of a detached node is on the wire."""
        return not self.nodes and self._plan is None

    def is_sending(self, node: Node, at_ns: int) -> bool:
        """Whether a frame of this node is on the wire."""
        plan = self._plan
        return plan is not None and plan.start_ns < at_ns and plan.involves(node)

    def wake(self, node: Node, at_ns: int) -> None:
        """A node has something to send."""
        if node not in self._ready:
            self._ready.append(node)
        start = max(at_ns, self.free_ns)
        self._first_ns = min(self._first_ns, start)
        if self._plan is not None and self._plan.start_ns >= at_ns:
            self._plan = None

    def interrupt(self, node: Node, at_ns: int) -> None:
        """The next that a node sends is an error flag: it destroys the frame on the wire, if any.

        On a free wire, or after what is left of an error frame or an intermission, it takes part in
        the arbitration.
        """
        plan = self._plan
        if plan is None or not plan.start_ns < at_ns < plan.done_ns:
            return
        bit = -(-(at_ns - plan.start_ns) * self._bit_rate // _SECOND_NS)
        what = cut_short(plan, Sending(node, node.queue.entries[0]), bit)
        self._plan = Plan(plan.sender, plan.entry, plan.start_ns, what, self._bit_rate)
        self._plan.heard_by = tuple(other for other in plan.heard_by if other is not node)

    def revise(self, at_ns: int) -> None:
        """The nodes or their states have changed, or a fault was injected."""
        self._listeners = tuple(
            node for node in self.nodes if node.state is not BUS_OFF and not node.wrong_bit_rate
        )
        rough = any(node.wrong_bit_rate for node in self.nodes)
        self._plain = len(self._listeners) > 1 and not rough
        self._others.clear()
        if self._plan is not None and self._plan.start_ns >= at_ns:
            self._plan = None

    # --- transmissions ---------------------------------------------------------------------------

    def next_ns(self) -> int:
        """Time of the next event, without further input; `NEVER`: no event is due."""
        plan = self._plan
        if plan is None and self._first_ns != NEVER:
            plan = self._plan = self._arbitrate(self._first_ns)
        if self.recovery.nodes:
            node = self.recovery.next(NEVER if plan is None else plan.start_ns)
            if node is not None:
                return self.recovery.back_ns(node)
        return NEVER if plan is None else plan.done_ns

    def run(self, to_ns: int, events: list[Event]) -> None:
        """Append the events through `to_ns`; a frame submitted at `to_ns` still takes part."""
        while True:
            plan = self._plan
            if plan is None and self._first_ns < to_ns:
                plan = self._plan = self._arbitrate(self._first_ns)
            if self.recovery.nodes:
                node = self.recovery.next(NEVER if plan is None else plan.start_ns)
                if node is not None and self.recovery.back_ns(node) <= to_ns:
                    self._report_state(node, self.recovery.finish(node), events)
                    continue
            if plan is None or plan.done_ns > to_ns:
                return
            self._complete(plan, events)

    def busy_until(self, now_ns: int) -> int:
        """Nanoseconds until now in which the wire was not free, intermissions included."""
        busy = self.busy_ns - max(0, self.free_ns - now_ns)
        if self._plan is not None:
            busy += max(0, now_ns - self._plan.start_ns)
        return busy

    def _arbitrate(self, start_ns: int) -> Plan:
        best: Node | None = None
        entry: Entry | None = None
        several = False
        for node in self._ready:
            if node.not_before_ns > start_ns:
                continue
            head = node.queue.entries[0]
            if entry is None or head.key < entry.key:
                best, entry, several = node, head, False
            elif head.key == entry.key:
                several = True
        if best is None or entry is None:
            self._first_ns = min(node.not_before_ns for node in self._ready)
            return self._arbitrate(self._first_ns)
        if self._plain and not several and not self._acting and entry.key != ERROR_KEY:
            plan = Plan(best, entry, start_ns, None, self._bit_rate)
            others = self._others.get(best)
            if others is None:
                others = tuple(node for node in self._listeners if node is not best)
                self._others[best] = others
            plan.heard_by = others
            return plan
        waiting = [
            Sending(node, node.queue.entries[0])
            for node in self.nodes
            if node in self._ready and node.not_before_ns <= start_ns
        ]
        if entry.key == ERROR_KEY:
            what = ordered(waiting)
        else:
            what = outcome(tied(waiting, entry), self.nodes, self._faults)
        first = (what.senders or what.orders)[0]
        plan = Plan(first.node, first.entry, start_ns, what, self._bit_rate)
        plan.heard_by = tuple(node for node in self._listeners if not plan.involves(node))
        return plan

    def _complete(self, plan: Plan, events: list[Event]) -> None:
        """The planned transmission has come to its end, or to its error."""
        what = plan.what
        self._plan = None
        free_ns = self.free_ns = plan.free_ns
        self.busy_ns += free_ns - plan.start_ns
        if what is None:
            events.append(
                Delivered(plan.done_ns, plan.start_ns, plan.sender, plan.entry.frame, plan.heard_by)
            )
            self._sent(plan.sender, plan.entry, plan, events)
            self._received(plan, events)
        elif what.error is None:
            self._transmitted(plan, what, events)
        else:
            self._failed(plan, what, what.error, events)
        self._first_ns = free_ns if self._ready else NEVER
        if self.recovery.nodes:
            self.recovery.count(plan.start_ns, free_ns)
        if self._failing:
            for node in [node for node in self._failing if plan.involves(node)]:
                self._failing.remove(node)
                self.fail(node, plan.done_ns, events)
        if self._moves:
            for node, to in self._moves.copy():
                self.move(node, to, plan.done_ns)

    def _sent(self, node: Node, entry: Entry, plan: Plan, events: list[Event]) -> None:
        """A node has sent a frame."""
        node.counters.sent += 1
        if node.attached:
            node.queue.sent(entry)
        if node.confinement.tec:
            node.confinement.sent()
            self._report_state(node, plan.done_ns, events)
        self._rest(node, plan)

    def _rest(self, node: Node, plan: Plan) -> None:
        """A node has sent, well or not: it may have to pause, or have nothing more to send."""
        if node.state is ERROR_PASSIVE:
            node.not_before_ns = plan.free_ns + SUSPEND_BITS * _SECOND_NS // self._bit_rate
        if not node.queue.entries and node in self._ready:
            self._ready.remove(node)

    def _withdraw(self, node: Node) -> None:
        """Let a node take no part in arbitration until it wakes."""
        if node in self._ready:
            self._ready.remove(node)
        if not self._ready:
            self._first_ns = NEVER

    def _received(self, plan: Plan, events: list[Event]) -> None:
        """All others have received a frame."""
        if self._troubled:
            for node in plan.heard_by:
                node.confinement.received()
                self._report_state(node, plan.done_ns, events)
            self._troubled = any(node.confinement.rec for node in self.nodes)

    def _transmitted(self, plan: Plan, what: Outcome, events: list[Event]) -> None:
        merged = tuple(sending.node for sending in what.senders[1:])
        frame = plan.entry.frame
        events.append(
            Delivered(plan.done_ns, plan.start_ns, plan.sender, frame, plan.heard_by, merged)
        )
        for node, entry in what.senders:
            self._sent(node, entry, plan, events)
        for node, _ in what.fallen:
            self._lost(node, ErrorKind.BIT, plan, events)
        self._received(plan, events)

    def _failed(self, plan: Plan, what: Outcome, kind: ErrorKind, events: list[Event]) -> None:
        self.errors += 1
        senders = tuple(sending.node for sending in what.senders)
        orders = tuple(order.node for order in what.orders)
        at_ns, frame = plan.done_ns, plan.entry.frame
        events.append(ErrorFrame(at_ns, plan.start_ns, plan.free_ns, kind, senders, frame, orders))
        if what.fault is not None:
            self._faults.count(what.fault)
        for node, entry in what.orders:
            node.counters.sent += 1
            if node.attached:
                node.queue.sent(entry)
            self._rest(node, plan)
        for node in senders:
            self._lost(node, kind, plan, events)
        for node, _ in what.fallen:
            self._lost(node, ErrorKind.BIT, plan, events)
        if kind is ErrorKind.ACK:
            return
        self._troubled = True
        for node in plan.heard_by if what.first is None else (*plan.heard_by, what.first):
            node.confinement.receive_failed(first=node is what.first)
            self._report_state(node, at_ns, events)

    def _lost(self, node: Node, kind: ErrorKind, plan: Plan, events: list[Event]) -> None:
        """An attempt of a node to send has failed."""
        node.counters.errors += 1
        node.counters.dropped += not node.attached
        if kind is ErrorKind.ACK:
            node.confinement.not_acknowledged()
        else:
            node.confinement.send_failed()
        self._report_state(node, plan.done_ns, events)
        self._rest(node, plan)

    def _report_state(self, node: Node, at_ns: int, events: list[Event]) -> None:
        """Report it if a node's counters have changed its state."""
        state = node.confinement.state
        if state is node.state or not node.attached:
            return
        node.state = state
        events.append(StateChanged(at_ns, node, state))
        if state is BUS_OFF:
            node.counters.dropped += node.queue.clear()
            if node.restart_ns is not None:
                self.recovery.start(node, at_ns + node.restart_ns)
        self.revise(at_ns)
