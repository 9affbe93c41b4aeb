"""Controllers that bus time doesn't wait for, and what they say late."""

from support.strangers import SECRET, Serving, Stranger

from bridge.can_bus.packet import BYE, DONE, SYNCHRONOUS
from bridge.frame import Frame

QUESTION = Frame(0x009, bytes(8))
OLD, NEW = Frame(0x00E, b"old"), Frame(0x00E, b"new")


def controller(serving: Serving) -> Stranger:
    late = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    late.hear()
    return late


def ask(serving: Serving, stamp_ns: int) -> None:
    serving.hub.deliver("r1", stamp_ns, (QUESTION,))


def say(serving: Serving, late: Stranger, stamp_ns: int, frame: Frame) -> None:
    late.frames(frame, flags=DONE, stamp_ns=stamp_ns)
    serving.serve()


def test_a_bus_does_not_wait_for_a_controller_that_is_excused(serving: Serving) -> None:
    controller(serving)
    ask(serving, 1)
    assert serving.hub.owing("r1") == ["r1"]
    serving.hub.excuse("r1")
    assert serving.hub.owing("r1") == []
    ask(serving, 2)
    assert serving.hub.owing("r1") == []


def test_it_still_hears_every_question_and_its_answers_are_dropped(serving: Serving) -> None:
    late = controller(serving)
    ask(serving, 1)
    serving.hub.excuse("r1")
    ask(serving, 2)
    assert [late.hear_question() for _ in range(2)] == [[QUESTION]] * 2
    assert not serving.hub.awake("r1")
    say(serving, late, 1, OLD)
    say(serving, late, 2, OLD)
    assert serving.hub.awake("r1")
    assert serving.hub.receive("r1") == []
    assert serving.hub.collect(0.0) == []


def test_recalled_it_is_waited_for_with_the_next_question_and_not_before(serving: Serving) -> None:
    late = controller(serving)
    for stamp_ns in (1, 2):
        ask(serving, stamp_ns)
        serving.hub.excuse("r1")
    serving.hub.recall("r1")
    assert serving.hub.owing("r1") == []
    ask(serving, 3)
    assert serving.hub.owing("r1") == ["r1"]
    for stamp_ns in (1, 2):  # a pair of its own each: these answer nothing any more
        say(serving, late, stamp_ns, OLD)
        assert serving.hub.owing("r1") == ["r1"]
    say(serving, late, 3, NEW)
    assert serving.hub.receive("r1") == [NEW]
    assert serving.hub.owing("r1") == []
    assert serving.hub.collect(0.0) == ["r1"]


def test_one_that_is_expelled_hears_why_and_another_process_may_come(serving: Serving) -> None:
    late = controller(serving)
    ask(serving, 1)
    serving.hub.excuse("r1")
    serving.hub.expel("r1", "dropped")
    late.hear_question()
    goodbye = late.hear()
    assert (goodbye.kind, goodbye.text) == (BYE, "dropped")
    assert (serving.hub.joined("r1"), serving.hub.left()) == (False, ("r1",))
    assert serving.hub.owing("r1") == []
    controller(serving)
    assert serving.hub.joined("r1")
    ask(serving, 2)
    assert serving.hub.owing("r1") == ["r1"]


def test_frames_that_were_dropped_leave_its_transmit_queue(runtime_folder) -> None:
    serving = Serving(queue=2)
    late = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    late.hear()
    serving.hub.forward("r1", 1, (), "r1")
    serving.hub.excuse("r1")
    late.hear()
    late.frames(OLD, OLD, flags=DONE, stamp_ns=1)
    serving.serve()
    assert serving.hub.submitted("r1") == []
    serving.hub.recall("r1")
    serving.hub.forward("r1", 2, (), "r1")
    assert late.hear().credit == 2
    serving.close()
