"""The inbox of a process, and what it answers."""

from collections import deque
from types import SimpleNamespace

from bridge.network.fault_orders import FaultOrder
from bridge.network.orders import OrderAnswer, OrderInbox
from bridge.network.refused_messages import Refusals
from bridge.network.run_orders import Pace, PaceOrder, Standstill
from configs.faults.bodies import Push


def test_an_answer_comes_out_as_it_went_in_but_for_what_a_terminal_would_obey() -> None:
    assert OrderAnswer.decode(OrderAnswer(7, 500).encode()) == OrderAnswer(7, 500)
    said = OrderAnswer.decode(OrderAnswer(7, 0, "\x1b[2J").encode())
    assert said is not None
    assert "\x1b" not in said.refusal


def test_an_inbox_takes_orders_counts_others_and_notes_that_time_stands_still() -> None:
    said: list[bytes] = []
    heard: list = []
    link = SimpleNamespace(
        publisher=lambda _: SimpleNamespace(put=said.append),
        each=lambda _, act: heard.append(act),
    )
    refusals = Refusals()
    inbox = OrderInbox(link, "run", "agent/r1", refusals)
    fault = FaultOrder(3, False, "push", ("r1",), Push(kind="push", at_s=0.0), 0, None, False)
    pause = PaceOrder(4, Pace.PAUSE)
    for payload in (fault.encode(), b"?", Standstill(8).encode(), pause.encode()):
        heard[0](payload)
    assert isinstance(inbox.waiting, deque)
    assert inbox.take() == [fault, pause]
    assert inbox.stands
    assert len(refusals.lines()) == 1
    inbox.answer(pause, 7)
    inbox.answer(fault, "why not")
    assert [OrderAnswer.decode(one) for one in said] == [
        OrderAnswer(4, 7),
        OrderAnswer(3, 0, "why not"),
    ]
