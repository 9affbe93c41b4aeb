"""One classic CAN bus as an event queue in bus time: arbitration, frame lengths, errors, load.

    submit     a node wants to send a frame at an instant; False: its queue is full, or it is off
    advance    what happened through an instant: frames delivered, error frames, changes of state
    next_ns    time of the next event, unless a node submits a frame before

* When the wire is free the lowest arbitration field wins; all others wait, at most one frame when
  theirs is lower still. A data frame beats a remote one of its identifier, 11 bits beat 29 with the
  same base. A frame submitted at the instant at which a frame starts takes part in the arbitration.
* A frame occupies the wire for its exact number of bits. All other nodes hear it at the end of its
  end of frame; the next one starts three bits later. What isn't acknowledged or is destroyed is
  sent again, and counted as in `confinement`; `outcome` says what destroys a frame.
* Every accepted frame is delivered exactly once, or queued, or counted as dropped. Frames of one
  node with one identifier stay in order.
* An error frame that a node submits is an injected error flag: at its turn in the node's queue it
  destroys the frame on the wire, or the frame that starts with it, or stands alone on an idle wire.
  All other nodes count the error; the injecting node does not.
* Times are integer nanoseconds and never go back: an instant before the last one is an error. The
  same calls give the same events, however often `next_ns` and `advance` are asked in between.

Bounds: everything that happens takes bits of the wire, so `advance` returns after as many steps as
frames fit into the time, even with a babbling or unacknowledged node. Not modelled:
propagation, clock tolerance, and that a node which drops out of a clash is back some bits later.
"""

from heapq import heappop, heappush
from typing import Final

from bridge.frame import ERR, Frame
from bridge.frame_faults import ActingFrameFault, FrameFaults
from bridge.wire.bits import ERROR_FRAME_BITS, arbitration_key, frame_bits
from bridge.wire.confinement import BUS_OFF
from bridge.wire.node import Babbler, Event, Node, time_of
from bridge.wire.queues import ERROR_KEY, Entry, Fifo, Queue
from bridge.wire.segment import Segment

MAX_BIT_RATE: Final = 1_000_000
MOST_BABBLES: Final = 2
"""Frames of a babbler that are queued: the one on the wire, and the next."""


class Wire:
    """A bus with its nodes."""

    def __init__(self, bitrate_bit_s: int) -> None:
        if not 1 <= bitrate_bit_s <= MAX_BIT_RATE:
            raise ValueError(
                f"bit rate {bitrate_bit_s} bit/s: classic CAN has 1 to {MAX_BIT_RATE} bit/s"
            )
        self.bitrate_bit_s = bitrate_bit_s
        self.now_ns = 0
        self.faults = FrameFaults()
        """The faults that act on its frames; tell `revise` after a change."""
        self._acting = self.faults.acting
        self._main = Segment(bitrate_bit_s, self.faults)
        self._apart: list[Segment] = []  # an open line leaves a node on a wire of its own
        self._events: list[Event] = []
        self._withheld: list[tuple[int, int, Node, Entry]] = []
        self._babblers: dict[Node, Babbler] = {}
        self._number = 0

    # --- nodes -----------------------------------------------------------------------------------

    def attach(
        self,
        name: str,
        *,
        queue: Queue | None = None,
        restart_ns: int | None = None,
        wrong_bit_rate: bool = False,
        of_drive: bool = False,
    ) -> Node:
        """Join a node now; `queue` is a host's FIFO of 10 if not given.

        `restart_ns`: how long after going bus-off it starts to recover; None: when told. At a wrong
        bit rate it hears nothing, and destroys what others say until it is error passive.
        """
        node = Node(
            name,
            Fifo() if queue is None else queue,
            restart_ns=restart_ns,
            wrong_bit_rate=wrong_bit_rate,
            of_drive=of_drive,
        )
        self._main.join(node, self.now_ns)
        return node

    def detach(self, node: Node) -> None:
        """Take a node off now: what it has queued is dropped, its frame on the wire goes on."""
        if not node.attached:
            return
        segment = self._segment(node)
        node.attached = False
        node.counters.dropped += node.queue.clear() - int(segment.is_sending(node, self.now_ns))
        kept = [held for held in self._withheld if held[2] is not node]
        node.counters.dropped += len(self._withheld) - len(kept)
        self._withheld = sorted(kept, key=lambda held: held[:2])
        self._babblers.pop(node, None)
        segment.leave(node, self.now_ns)
        self._forget_empty()

    def restart(self, node: Node) -> None:
        """Tell a node that is bus-off to come back: after 128 times 11 recessive bits it is."""
        if node.state is BUS_OFF and node.attached:
            self._segment(node).recovery.start(node, self.now_ns)

    def fail(self, node: Node) -> None:
        """Take a node off the bus as its error counters would, at the end of its frame if any."""
        if node.attached and node.state is not BUS_OFF:
            self._segment(node).fail(node, self.now_ns, self._events)

    def discard(self, node: Node) -> None:
        """Drop what a node has queued; its frame on the wire goes on."""
        if node.attached:
            node.counters.dropped += self._segment(node).discard(node, self.now_ns)

    def disconnect(self, *nodes: Node) -> None:
        """Open the line to some nodes: only each other they hear. Frames on the wire go on."""
        segment = Segment(self.bitrate_bit_s, self.faults)
        self._apart.append(segment)
        for node in nodes:
            if node.attached:
                self._segment(node).move(node, segment, self.now_ns)
        self._forget_empty()

    def reconnect(self, node: Node) -> None:
        """Close the line again."""
        if node.attached:
            self._segment(node).move(node, self._main, self.now_ns)
            self._forget_empty()

    def babble(self, node: Node, frame: Frame, period_ns: int) -> None:
        """Let a node send a frame now and every `period_ns`, beside the frames in its queue.

        Two of them at most wait: where its wire is slower, it sends one after the other.
        """
        present = self._babblers.get(node)
        if present is None or (present.frame, present.period_ns) != (frame, period_ns):
            self._babblers[node] = Babbler(self.now_ns, frame, period_ns)

    def quieten(self, node: Node) -> None:
        """Let a node babble no more."""
        self._babblers.pop(node, None)

    # --- frames ----------------------------------------------------------------------------------

    def submit(self, node: Node, frame: Frame, at_ns: int) -> bool:
        """Queue a frame at a node; False: no room (ENOBUFS), or the node is bus-off.

        Faults don't concern error frames.

        Raises:
            ValueError: no classic frame, a node that has left, or an instant in the past.
        """
        if at_ns != self.now_ns:
            self._run(at_ns)
        if not node.attached:
            raise ValueError(f"{node.name} has left the bus and can't send 0x{frame.can_id:X}")
        if frame.can_id & ERR:
            return self._order_error(node, frame)
        bits = frame_bits(frame)
        self._number += 1
        entry = Entry(arbitration_key(frame.can_id), self._number, frame, bits)
        if self._acting:
            found = self.faults.take(frame, of_drive=node.of_drive)
            if found is not None:
                return self._apply(found, node, entry)
        return self._queue(node, entry)

    def advance(self, to_ns: int) -> list[Event]:
        """All events through `to_ns` since the last call, in order.

        Raises:
            ValueError: an instant in the past.
        """
        self._run(to_ns)
        events = self._events
        if events:
            self._events = []
        return events

    def next_ns(self) -> int:
        """Time of the next event, unless a node submits a frame; `NEVER`: no event is due."""
        if self._events:
            return time_of(self._events[0])
        return self._next_ns()

    # --- faults and figures ----------------------------------------------------------------------

    def revise(self) -> None:
        """The faults have changed."""
        for segment in (self._main, *self._apart):
            segment.revise(self.now_ns)

    @property
    def busy_ns(self) -> int:
        """How long the wire was occupied so far; its growth over a window is the window's load."""
        return self._main.busy_until(self.now_ns)

    @property
    def load(self) -> float:
        """Share of all time so far in which the wire was occupied, 0 to 1."""
        return self.busy_ns / self.now_ns if self.now_ns else 0.0

    @property
    def errors(self) -> int:
        """Error frames so far."""
        return self._main.errors

    # --- inside ----------------------------------------------------------------------------------

    def _segment(self, node: Node) -> Segment:
        for segment in self._apart:
            if node in segment.nodes:
                return segment
        return self._main

    def _forget_empty(self) -> None:
        segments = (self._main, *self._apart)
        self._apart = [
            segment
            for segment in self._apart
            if not segment.deserted() or any(other.awaits(segment) for other in segments)
        ]

    def _queue(self, node: Node, entry: Entry) -> bool:
        if node.state is BUS_OFF or not node.queue.push(entry):
            node.counters.refused += 1
            return False
        node.counters.accepted += 1
        segment = self._segment(node) if self._apart else self._main
        segment.wake(node, self.now_ns)
        return True

    def _order_error(self, node: Node, frame: Frame) -> bool:
        self._number += 1
        entry = Entry(ERROR_KEY, self._number, frame, ERROR_FRAME_BITS)
        if not self._queue(node, entry):
            return False
        if node.queue.entries[0] is entry:
            self._segment(node).interrupt(node, self.now_ns)
        return True

    def _apply(self, found: ActingFrameFault, node: Node, entry: Entry) -> bool:
        """Apply a fault to a frame on its way to the controller."""
        match found.kind:
            case "can_drop":
                node.counters.accepted += 1
                node.counters.dropped += 1
                return True
            case "can_delay":
                node.counters.accepted += 1
                held = (self.now_ns + found.delay_ns, entry.number, node, entry)
                heappush(self._withheld, held)
                return True
            case "can_duplicate":
                taken = self._queue(node, entry)
                self._number += 1
                self._queue(node, Entry(entry.key, self._number, entry.frame, entry.bits))
                return taken
            case _:
                raise ValueError(f"{found.kind} has no effect before a controller")

    def _release(self) -> None:
        """A withheld frame's time has come; without room for it, it is lost."""
        _, _, node, entry = heappop(self._withheld)
        if self._queue(node, entry):
            node.counters.accepted -= 1
        else:
            node.counters.refused -= 1
            node.counters.dropped += 1

    def _say_again(self, node: Node, frame: Frame) -> None:
        """A node that babbles sends its frame."""
        waiting = sum(entry.frame is frame for entry in node.queue.entries)
        if node.state is BUS_OFF or waiting >= MOST_BABBLES:
            node.counters.refused += 1
            return
        node.counters.accepted += 1
        self._number += 1
        entry = Entry(arbitration_key(frame.can_id), self._number, frame, frame_bits(frame))
        node.queue.put(entry)
        self._segment(node).wake(node, self.now_ns)

    def _next_ns(self) -> int:
        if not (self._apart or self._withheld or self._babblers):
            return self._main.next_ns()
        times = [self._main.next_ns(), *(segment.next_ns() for segment in self._apart)]
        times += [babbler.next_ns for babbler in self._babblers.values()]
        if self._withheld:
            times.append(self._withheld[0][0])
        return min(times)

    def _run(self, to_ns: int) -> None:
        if to_ns < self.now_ns:
            raise ValueError(f"bus time {to_ns} ns is in the past; it is {self.now_ns} ns already")
        while self._withheld or self._apart or self._babblers:
            next_ns = self._next_ns()
            if next_ns > to_ns:
                break
            self._step(next_ns)
        self.now_ns = to_ns
        self._main.run(to_ns, self._events)

    def _step(self, to_ns: int) -> None:
        """Run all segments to the next event of one of them."""
        self.now_ns = to_ns
        self._main.run(to_ns, self._events)
        for segment in self._apart:
            segment.run(to_ns, self._events)
        self._forget_empty()
        while self._withheld and self._withheld[0][0] <= to_ns:
            self._release()
        for node, babbler in self._babblers.items():
            if babbler.next_ns <= to_ns:
                babbler.next_ns += babbler.period_ns
                self._say_again(node, babbler.frame)
