"""The inbox of a process for what is ordered during a run, and its answers.

Orders come from the launcher, or through the plant.

    OrderAnswer  [1, number, tick, refusal] @answer/<process>
"""

from collections import deque
from typing import NamedTuple

from bridge.network import keys
from bridge.network.fault_orders import MOST_TEXT, FaultOrder
from bridge.network.packing import ints, pack, printable, unpack
from bridge.network.refused_messages import Refusals
from bridge.network.run_orders import LeaderOrder, PaceOrder, Standstill
from bridge.network.zenoh_link import ZenohLink
from configs.roles import LAUNCHER

Order = FaultOrder | LeaderOrder | PaceOrder
MOST_WAITING = 1 << 10
"""Orders that one process keeps until its next tick; older ones are dropped unanswered."""
_KINDS = (FaultOrder, LeaderOrder, PaceOrder, Standstill)


class OrderAnswer(NamedTuple):
    """What a process does with an order."""

    number: int
    tick: int  # at which it acts
    refusal: str = ""  # why it doesn't; "" if it does

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self._replace(refusal=self.refusal[:MOST_TEXT]))

    @classmethod
    def decode(cls, payload: bytes) -> "OrderAnswer | None":
        """The message in the bytes, None if there is none."""
        read = unpack(payload, 4)
        if read is None or not ints(read[1:3]):
            return None
        if type(read[3]) is not str or len(read[3]) > MOST_TEXT:
            return None
        return cls(read[1], read[2], printable(read[3]))


def order_of(payload: bytes) -> Order | Standstill | None:
    """The order in the bytes, None if there is none; layouts differ in their lengths."""
    for kind in _KINDS:
        if (order := kind.decode(payload)) is not None:
            return order
    return None


class OrderInbox:
    """Orders to one process: they come on the network's thread, its loop takes them.

    `waiting` is looked at once per tick; nothing else costs while there are none.

    Args:
        link: of the process.
        run: of the orders.
        process: that carries them out.
        refusals: count what is no order.
    """

    def __init__(self, link: ZenohLink, run: str, process: str, refusals: Refusals) -> None:
        self.waiting: deque[bytes] = deque(maxlen=MOST_WAITING)
        self.stands = False
        """Whether time was said to stand still; who asks takes it back."""
        self._refusals = refusals
        self._answers = link.publisher(keys.answer(run, process))
        link.each(keys.order(run, process), self.waiting.append)

    def take(self) -> list[Order]:
        """The orders that have come; what is none is counted and dropped."""
        orders: list[Order] = []
        while self.waiting:
            match order_of(self.waiting.popleft()):
                case None:
                    self._refusals.note("order", LAUNCHER.name, "not well formed")
                case Standstill():
                    self.stands = True
                case order:
                    orders.append(order)
        return orders

    def answer(self, order: Order, tick: int | str) -> None:
        """Say the tick at which an order acts, or why it doesn't."""
        if isinstance(tick, str):
            said = OrderAnswer(order.number, 0, tick)
        else:
            said = OrderAnswer(order.number, tick)
        self._answers.put(said.encode())
