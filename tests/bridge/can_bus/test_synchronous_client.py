"""A robot's own controller in lockstep: the hub waits for its answers."""

import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.hub_running import Remote

from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub
from bridge.can_bus.interface import FleetloopBus
from bridge.frame import Frame

LEAVE = 0x7FF


CONTROLLERS = {"r1": {"r1": "told to nobody else"}}


OWN: dict[str, Any] = {"synchronous": "r1", "secret": "told to nobody else"}


def answered(hub: Hub) -> bool:
    """Whether the bus answers within ten seconds."""
    return any(hub.collect(0.01) for _ in range(1000))


def answer_messages(bus: FleetloopBus) -> None:
    while (message := bus.recv(10.0)) is None or message.arbitration_id != LEAVE:
        if message is not None and message.arbitration_id == 0x009:
            bus.send(can.Message(arbitration_id=0x00E, data=message.data[:4]))
            bus.send(can.Message(arbitration_id=0x02E, data=message.data[4:]))


def answer_frames(bus: FleetloopBus) -> None:
    while True:
        for _, frame in bus.client.receive_timed_frames(10.0) or ():
            if frame.can_id == LEAVE:
                return
            if frame.can_id == 0x009:
                bus.client.send(Frame(0x00E, frame.data[:4]))
                bus.client.send(Frame(0x02E, frame.data[4:]))


@pytest.fixture(params=[answer_messages, answer_frames])
def synchronous(request, where: str, runtime_folder, tmp_path: Path) -> Iterator[Hub]:
    """A hub driven by the test, and a synchronous client in a thread, as a controller."""
    folder = sockets.create_run_folder("test")
    hub = Hub(sockets.listen(folder, ("r1",)), controllers=CONTROLLERS)
    remote = Remote(tmp_path) if where == "remote" else None
    settings = remote.settings() if remote is not None else {}

    def answer() -> None:
        bus = can.Bus(interface="fleetloop", channel="r1", **OWN, **settings)
        with suppress(can.CanOperationError):
            request.param(bus)
        bus.shutdown()

    thread = threading.Thread(target=answer)
    thread.start()
    assert hub.await_controllers(10.0) == ()
    yield hub
    hub.close("the test is over")
    thread.join()
    if remote is not None:
        remote.close()
    sockets.remove_run_folder(folder)


def test_collect_returns_with_all_that_a_synchronous_client_had_to_say(synchronous) -> None:
    hub = synchronous
    for k in range(200):
        data = k.to_bytes(4, "little") + bytes(4)
        hub.deliver("r1", k, (Frame(0x009, data),))
        assert answered(hub)
        frames = hub.receive("r1")
        assert [frame.can_id & 0x7FF for frame in frames] == [0x00E, 0x02E]
        assert frames[0].data == k.to_bytes(4, "little")


def test_a_synchronous_client_with_nothing_to_say_still_answers(synchronous) -> None:
    hub = synchronous
    hub.deliver("r1", 0, (Frame(0x001, bytes(8)),))
    assert answered(hub)
    assert hub.receive("r1") == []


def test_frames_come_together_and_with_their_times(running, join) -> None:
    client = join(batched=True).client
    assert client.receive_timed_frames(0.0) is None
    running.deliver(Frame(0x009, b"abc"), Frame(0x029, b""), stamp_ns=1_500_000_000)
    heard = client.receive_timed_frames(5.0)
    assert heard == [
        (1_500_000_000, Frame(0x009, b"abc")),
        (1_500_000_000, Frame(0x029, b"")),
    ]


def test_what_is_no_frame_is_refused_before_it_is_sent(join) -> None:
    client = join(batched=True).client
    with pytest.raises(can.CanOperationError, match="not sent: 9 bytes of data"):
        client.send(Frame(0x009, bytes(9)))
    with pytest.raises(can.CanOperationError, match="not sent: 11-bit identifier 0x800"):
        client.send(Frame(0x800, b""))


def test_a_listener_beside_a_synchronous_client_changes_nothing(synchronous) -> None:
    hub = synchronous
    listener: list[can.BusABC] = []
    opener = threading.Thread(
        target=lambda: listener.append(can.Bus(interface="fleetloop", channel="r1"))
    )
    opener.start()
    while opener.is_alive():
        hub.collect(0.0)
    for k in range(50):
        hub.deliver("r1", k, (Frame(0x009, bytes(8)),))
        assert answered(hub)
        assert len(hub.receive("r1")) == 2
    heard = [listener[0].recv(5.0).arbitration_id & 0x7FF for _ in range(150)]
    assert heard == [0x009, 0x00E, 0x02E] * 50
    listener[0].shutdown()


def test_a_synchronous_client_that_leaves_is_named_and_waited_for_no_longer(synchronous) -> None:
    hub = synchronous
    hub.deliver("r1", 0, (Frame(LEAVE, b""),))
    hub.collect(10.0)
    while not hub.left():
        hub.collect(0.0)
    assert hub.left() == ("r1",)
    assert hub.clients() == 0
    hub.deliver("r1", 1, (Frame(0x009, bytes(8)),))
    assert hub.left() == ("r1",)


@given(st.lists(st.binary(max_size=64), max_size=5))
def test_garbage_from_a_client_is_counted_and_harms_nobody(garbage: list[bytes]) -> None:
    import os
    import socket
    import tempfile

    with tempfile.TemporaryDirectory(prefix="fl-", dir="/tmp") as folder:
        os.environ["FLEETLOOP_RUNTIME"] = folder
        run = sockets.create_run_folder("garbage")
        hub = Hub(sockets.listen(run, ("r1",)))
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
            stranger.connect(str(sockets.socket_path(run, "r1")))
            for data in garbage:
                stranger.send(data)
            for _ in range(len(garbage) + 2):
                hub.collect(0.0)
        hub.collect(0.0)
        assert hub.receive("r1") == []
        hub.close("")
