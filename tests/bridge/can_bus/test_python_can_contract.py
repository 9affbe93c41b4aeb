"""What programs on python-can rely on: tasks, notifiers, threads, busy hubs."""

import errno
import threading

import can
import pytest

from bridge.frame import Frame

LOCAL_ONLY = pytest.mark.parametrize("where", ["local"], indirect=True)


def test_periodic_tasks_of_python_can_send_until_they_are_stopped(running, join) -> None:
    bus = join()
    message = can.Message(arbitration_id=0x123, is_extended_id=False)
    task = bus.send_periodic(message, 0.002)
    frames = running.taken(5)
    task.stop()
    assert set(frames) == {Frame(0x123, b"")}


def test_a_notifier_hands_every_frame_to_its_listeners(running, join) -> None:
    bus = join()
    reader = can.BufferedReader()
    notifier = can.Notifier(bus, [reader])
    running.deliver(*(Frame(0x100 + n, b"") for n in range(50)))
    heard = [reader.get_message(5.0) for _ in range(50)]
    notifier.stop()
    assert [message.arbitration_id for message in heard] == list(range(0x100, 0x132))


def test_several_threads_may_share_a_thread_safe_bus(running) -> None:
    settings = running.remote.settings() if running.remote is not None else {}
    with can.ThreadSafeBus(interface="fleetloop", channel="r1", **settings) as bus:

        def send(first: int) -> None:
            for n in range(100):
                message = can.Message(arbitration_id=first + n, is_extended_id=False)
                bus.send(message, timeout=10.0)

        threads = [threading.Thread(target=send, args=(k * 0x100,)) for k in range(4)]
        for thread in threads:
            thread.start()
        frames = running.taken(400)
        for thread in threads:
            thread.join()
    assert len(set(frames)) == 400
    for k in range(4):
        of_one = [frame.can_id for frame in frames if frame.can_id >> 8 == k]
        assert of_one == sorted(of_one)


def test_what_gathers_waits_for_a_busy_hub_and_loses_nothing(running, join) -> None:
    bus = join(batched=True)
    sent = list(range(3000))
    done = threading.Event()

    def send() -> None:
        for n in sent:
            bus.send(can.Message(arbitration_id=1, is_extended_id=False, data=n.to_bytes(2, "big")))
            bus.recv(0.0)
        done.set()

    sender = threading.Thread(target=send)
    with running.lock:  # the hub is busy
        sender.start()
        assert not done.wait(0.2)
    frames = running.taken(3000)
    sender.join()
    assert [int.from_bytes(frame.data, "big") for frame in frames] == sent


def test_a_hub_that_does_not_read_is_a_full_transmit_buffer_within_the_timeout(
    running, join
) -> None:
    bus = join()
    message = can.Message(arbitration_id=1, is_extended_id=False)
    sent = 0
    with running.lock:
        with pytest.raises(can.CanOperationError, match="transmit buffer full") as caught:
            while sent < 5000:
                bus.send(message, timeout=0.05)
                sent += 1
        assert caught.value.error_code == errno.ENOBUFS
        with pytest.raises(can.CanOperationError, match="transmit buffer full"):
            bus.send(message)
    assert len(running.taken(sent)) == sent
    bus.send(message, timeout=5.0)
    assert len(running.taken(1)) == 1


@LOCAL_ONLY
def test_what_a_client_sent_before_it_closed_arrives_though_it_left_frames_unread(
    running, join
) -> None:
    bus = join()
    running.deliver(*(Frame(0x100 + n, b"") for n in range(20)))
    with running.lock:  # the kernel tells the hub of a reset before it hands out what was sent
        for n in range(20):
            bus.send(can.Message(arbitration_id=0x200 + n, is_extended_id=False))
        bus.shutdown()
    assert [frame.can_id for frame in running.taken(20)] == list(range(0x200, 0x214))


def test_what_a_client_sent_before_it_closed_arrives_though_frames_were_on_their_way_to_it(
    running, join
) -> None:
    bus = join()
    for n in range(20):
        bus.send(can.Message(arbitration_id=0x200 + n, is_extended_id=False))
    bus.shutdown()
    for n in range(20):
        running.deliver(Frame(0x100 + n, b""))
    assert [frame.can_id for frame in running.taken(20)] == list(range(0x200, 0x214))
