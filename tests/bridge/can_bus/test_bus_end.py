"""The end of a bus, and clients that leave it or don't read."""

import threading

import can
import pytest
from support.hub_running import lost_at

from bridge.can_bus import connection, zenoh_transport
from bridge.frame import Frame

LOCAL_ONLY = pytest.mark.parametrize("where", ["local"], indirect=True)

MESSAGE = can.Message(arbitration_id=1, is_extended_id=False)


def test_the_end_of_the_bus_is_an_error_that_says_why(running, join) -> None:
    bus = join()
    running.deliver(Frame(1, b""))
    running.close()
    assert bus.recv(5.0).arbitration_id == 1  # nothing that was said is lost
    with pytest.raises(can.CanOperationError, match="the test is over"):
        bus.recv(5.0)


def test_who_sends_to_a_bus_that_has_ended_is_told_why_and_can_still_read_what_was_said(
    running, join
) -> None:
    bus = join()
    running.deliver(Frame(1, b""), Frame(2, b""))
    running.close()

    def send() -> None:
        while True:
            bus.send(MESSAGE, timeout=1.0)

    for _ in range(2):
        with pytest.raises(can.CanOperationError, match=r"the test is over|the bus has gone"):
            send()
    assert [bus.recv(5.0).arbitration_id for _ in range(2)] == [1, 2]


def test_who_is_behind_when_the_bus_ends_still_gets_all_of_it_and_the_reason(running, join) -> None:
    bus = join()
    heard: list[int] = []
    for k in range(5000):
        running.deliver(Frame(1, k.to_bytes(4, "big")))

    def read() -> None:
        with pytest.raises(can.CanOperationError, match="the test is over"):
            while True:
                heard.append(int.from_bytes(bus.recv(5.0).data, "big"))

    reader = threading.Thread(target=read)
    reader.start()
    running.close()
    reader.join()
    assert heard == list(range(5000))


def test_who_does_not_read_delays_the_end_of_the_bus_by_a_bound(running, join) -> None:
    join()
    for _ in range(3000):
        running.deliver(Frame(1, b""))
    closer = threading.Thread(target=running.close)
    closer.start()
    closer.join(20.0)
    assert not closer.is_alive()


@pytest.mark.parametrize("wait_s", [None, 0.04, 60.0])
def test_shutdown_wakes_who_waits_in_another_thread(running, join, wait_s: float | None) -> None:
    bus = join()
    told: list[str] = []
    waiting = threading.Event()

    def read() -> None:
        with pytest.raises(can.CanOperationError) as caught:
            while True:
                waiting.set()
                bus.recv(wait_s)
        told.append(str(caught.value))

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    assert waiting.wait(5.0)
    reader.join(0.05)
    bus.shutdown()
    reader.join(5.0)
    assert not reader.is_alive()
    assert told == ["bus 'r1' was shut down"]


def test_shutdown_wakes_who_waits_for_room_to_send(running, join) -> None:
    bus = join()
    errors: list[str] = []
    sent = threading.Event()

    def write() -> None:
        with pytest.raises(can.CanOperationError) as caught:
            while True:
                bus.send(MESSAGE, timeout=60.0)
                sent.set()
        errors.append(str(caught.value))

    writer = threading.Thread(target=write, daemon=True)
    with running.lock:  # the hub is busy
        writer.start()
        assert sent.wait(5.0)
        writer.join(0.3)
        closer = threading.Thread(target=bus.shutdown, daemon=True)
        closer.start()
        writer.join(5.0)
        assert not writer.is_alive()
    closer.join(5.0)
    assert errors == ["bus 'r1' was shut down"]


def test_after_shutdown_nothing_can_be_sent_or_received(running, join) -> None:
    for batched in (False, True):
        bus = join(batched=batched)
        bus.shutdown()
        for _ in range(2):
            with pytest.raises(can.CanOperationError, match="was shut down"):
                bus.recv(0.01)
            with pytest.raises(can.CanOperationError, match="was shut down"):
                bus.send(MESSAGE)


def test_who_is_behind_by_more_than_is_kept_is_told_how_much_it_lost(
    running, join, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "BACKLOG", 500)
    monkeypatch.setattr(zenoh_transport, "BACKLOG", 100)
    bus = join()
    for k in range(5000):
        running.deliver(Frame(1, k.to_bytes(4, "big")))
    heard: list[int] = []

    def read() -> None:
        while (heard_now := bus.recv(1.0)) is not None:
            heard.append(int.from_bytes(heard_now.data, "big"))

    read()
    assert heard == sorted(set(heard))
    lost = 5000 - len(heard)
    assert lost > 2000
    for k in range(5000, 5010):
        running.deliver(Frame(1, k.to_bytes(4, "big")))
    read()
    assert (heard[-10:], bus.lost) == (list(range(5000, 5010)), lost)
    running.close()
    with pytest.raises(can.CanOperationError, match=f"the test is over; {lost} frames"):
        bus.recv(5.0)


@LOCAL_ONLY
def test_who_takes_nothing_at_the_end_finds_how_much_it_lost(running, join) -> None:
    bus, reader = join(), join()
    for k in range(3000):
        running.deliver(Frame(1, k.to_bytes(4, "big")))
    assert [reader.recv(5.0) is not None for _ in range(3000)] == [True] * 3000
    running.close()
    heard = 0
    with pytest.raises(can.CanOperationError, match="the test is over; ") as caught:
        while bus.recv(5.0) is not None:
            heard += 1
    assert 0 < heard < 3000
    assert f"; {3000 - heard} frames for it were lost" in str(caught.value)
    assert bus.lost == lost_at(running.hub, "r1") == 3000 - heard


def test_shutdown_twice_is_once(running, join) -> None:
    bus = join()
    bus.shutdown()
    bus.shutdown()
