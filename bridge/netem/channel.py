"""One directed edge of the emulated network: messages in with their send time, out when due.

    sent → cut? → too far? → lost? → waits for the bandwidth → delay → cut? → due, once or twice

All in scenario time. Every message takes part in every draw, in the order of sending, whatever its
fate, and each effect has a random stream of its own, named by seed, edge and effect: edges and
directions are independent, and a change of one effect changes no draw of another. Second copies
have their delays from a stream of their own. Faults lose and delay more while they act.
"""

from collections import deque
from dataclasses import dataclass, fields
from heapq import heappop, heappush
from random import Random
from typing import Generic, NamedTuple, TypeVar

from bridge.netem.delay import delay_draw
from bridge.netem.loss import distance_draw, loss_draw
from configs.netem import Effects

MESSAGE_BYTES = 128
QUEUE_MESSAGES = 64

Message = TypeVar("Message")


@dataclass(slots=True)
class Counts:
    """Messages of an edge. sent + duplicated = delivered + lost + messages under way."""

    sent: int = 0
    duplicated: int = 0
    delivered: int = 0
    lost: int = 0
    reordered: int = 0
    """Delivered after a message that was sent later."""
    late: int = 0
    """Delivered older than the age limit."""

    def as_dict(self) -> dict[str, int]:
        """By name."""
        return {one.name: getattr(self, one.name) for one in fields(self)}


class Delivery(NamedTuple, Generic[Message]):
    """A message that came out of a channel."""

    sent_ns: int
    message: Message


class Channel(Generic[Message]):
    """The emulated edge from one source to one robot.

    Args:
        effects: of the edge.
        seed: names its random streams.
        age_limit_ns: a message older than this at its delivery counts as late.
    """

    __slots__ = (
        "_age_limit_ns",
        "_copy_delay",
        "_delay",
        "_distance_loss",
        "_due",
        "_duplication",
        "_duplication_draw",
        "_fault_cut",
        "_fault_delay_ns",
        "_fault_draw",
        "_fault_loss",
        "_free_ns",
        "_in_order",
        "_last_due_ns",
        "_loss",
        "_newest_ns",
        "_number",
        "_partitions",
        "_queue",
        "_queue_messages",
        "_transmission_ns",
        "counts",
    )

    def __init__(self, effects: Effects, seed: str, age_limit_ns: int) -> None:
        self._delay = delay_draw(effects.delay, Random(f"{seed} delay"))
        self._loss = loss_draw(effects.loss, Random(f"{seed} loss"))
        self._distance_loss = distance_draw(effects.distance, Random(f"{seed} distance"))
        self._duplication = effects.duplication or 0.0
        self._duplication_draw = Random(f"{seed} duplication").random
        self._copy_delay = delay_draw(effects.delay, Random(f"{seed} copy delay"))
        self._copy_delay()  # of a trace a message takes a line, its copy the next one
        self._in_order = effects.reordering is False
        bits = 8 * (effects.message_bytes or MESSAGE_BYTES)
        rate = effects.bandwidth_bit_s
        self._transmission_ns = round(bits / rate * 1e9) if rate else 0
        self._queue_messages = effects.queue_messages or QUEUE_MESSAGES
        self._partitions = [
            (round(cut.from_s * 1e9), round(cut.to_s * 1e9)) for cut in effects.partitions or ()
        ]
        self._age_limit_ns = age_limit_ns
        self._due: list[tuple[int, int, int, Message]] = []  # due, number, sent
        self._number = 0
        self._queue: deque[int] = deque()  # when each waiting message has left
        self._free_ns = 0
        self._last_due_ns = 0
        self._newest_ns: int | None = None
        self._fault_cut = False
        self._fault_delay_ns, self._fault_loss = 0, 0.0
        self._fault_draw = Random(f"{seed} fault").random
        self.counts = Counts()

    def disturb(self, delay_s: float, loss: float, *, cut: bool) -> None:
        """Lose and delay more than the effects, from now on: in the end 0, 0 and no cut.

        A cut loses what is sent or due while it lasts, as a partition does.
        """
        self._fault_delay_ns, self._fault_loss, self._fault_cut = round(delay_s * 1e9), loss, cut

    def send(self, now_ns: int, message: Message, distance_m: float = 0.0) -> None:
        """Take a message that its source sends now, from this far; times must not decrease."""
        counts = self.counts
        counts.sent += 1
        lost = self._loss() | self._distance_loss(distance_m)
        if self._fault_loss:
            lost |= self._fault_draw() < self._fault_loss
        delay_ns = self._delay()
        copied, copy_delay_ns = False, None
        if self._duplication:
            copied, copy_delay_ns = self._duplication_draw() < self._duplication, self._copy_delay()
        if lost or delay_ns is None or self._fault_cut or self._is_cut(now_ns):
            counts.lost += 1
            return
        left_ns = self._leaves(now_ns)
        if left_ns is None:
            counts.lost += 1
            return
        left_ns += self._fault_delay_ns
        self._await(now_ns, left_ns + delay_ns, message)
        if copied:
            counts.duplicated += 1
            if copy_delay_ns is None:
                counts.lost += 1
            else:
                self._await(now_ns, left_ns + copy_delay_ns, message)

    @property
    def next_due_ns(self) -> int | None:
        """When the next message arrives, None if none is under way."""
        return self._due[0][0] if self._due else None

    def receive(self, now_ns: int, *, exists: bool = True) -> list[Delivery[Message]]:
        """The messages that are due, in the order in which they arrive.

        Where the edge doesn't exist now, they are lost.
        """
        due, counts = self._due, self.counts
        arrived: list[Delivery[Message]] = []
        while due and due[0][0] <= now_ns:
            _, _, sent_ns, message = heappop(due)
            if not exists or self._fault_cut:
                counts.lost += 1
                continue
            counts.delivered += 1
            if self._newest_ns is not None and sent_ns < self._newest_ns:
                counts.reordered += 1
            else:
                self._newest_ns = sent_ns
            counts.late += now_ns - sent_ns > self._age_limit_ns
            arrived.append(Delivery(sent_ns, message))
        return arrived

    def _is_cut(self, at_ns: int) -> bool:
        return any(from_ns <= at_ns < to_ns for from_ns, to_ns in self._partitions)

    def _leaves(self, now_ns: int) -> int | None:
        """When a message has left through the bandwidth; None: the queue is full."""
        if not self._transmission_ns:
            return now_ns
        queue = self._queue
        while queue and queue[0] <= now_ns:
            queue.popleft()
        if len(queue) > self._queue_messages:  # the first one is leaving, it waits no more
            return None
        self._free_ns = max(self._free_ns, now_ns) + self._transmission_ns
        queue.append(self._free_ns)
        return self._free_ns

    def _await(self, sent_ns: int, due_ns: int, message: Message) -> None:
        if self._in_order:
            due_ns = self._last_due_ns = max(due_ns, self._last_due_ns)
        if self._is_cut(due_ns):
            self.counts.lost += 1
            return
        self._number += 1
        heappush(self._due, (due_ns, self._number, sent_ns, message))
