"""A bus from another machine: the same hub over Zenoh, by password or by certificate."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from bridge import access
from bridge.can_bus import places
from bridge.can_bus.hub import Hub
from bridge.can_bus.relay import Relay
from bridge.frame import Frame
from bridge.zenoh_link import open_router

RUN = "remote"
GRANTED = {"bench": ("r1",), "boss": ("*",)}


class Running:
    """A router with its relay, and a hub that a thread keeps going."""

    def __init__(self, folder: Path) -> None:
        sockets = places.create_run_folder(RUN)
        self.hub = Hub(places.listen(sockets, ("r1", "r2")))
        self._lock, self._over = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()
        words = {"bench": "agreed", "boss": "secret"}
        plan = access.plan(
            RUN, ("r1", "r2"), {"r1": (), "r2": ()}, ("r1",), guests=words, bus_guests=GRANTED
        )
        self._router = open_router(None, plan, folder)
        self.link = self._router.__enter__()
        self.relay = Relay(self.link, sockets, ("r1", "r2"), GRANTED)
        self.words = words

    def _serve(self) -> None:
        while not self._over.is_set():
            with self._lock:
                self.hub.collect(0.0)
            self._over.wait(0.001)

    def deliver(self, *frames: Frame, bus: str = "r1", stamp_ns: int = 1_000_000) -> None:
        with self._lock:
            self.hub.deliver(bus, stamp_ns, frames)

    def until(self, what: Callable[[], object]) -> bool:
        for _ in range(5000):
            with self._lock:
                if what():
                    return True
            self._over.wait(0.001)
        return False

    def open(self, channel: str = "r1", user: str = "bench", **options) -> can.BusABC:
        settings = {"password": self.words.get(user, ""), "connect_timeout": 5.0} | options
        return can.Bus(
            interface="fleetloop",
            channel=channel,
            endpoint=self.link.endpoint,
            user=user,
            **settings,
        )

    def close(self, reason: str = "the test is over") -> None:
        self._over.set()
        self._thread.join()
        self.hub.close(reason)
        self.relay.close()
        self._router.__exit__(None, None, None)
        places.remove_run_folder(places.base_folder() / RUN)


@pytest.fixture
def running(runtime_folder, tmp_path: Path) -> Iterator[Running]:
    running = Running(tmp_path)
    yield running
    running.close()


def test_frames_go_both_ways_lossless_in_order_and_without_echo(running: Running) -> None:
    with running.open() as guest, can.Bus(interface="fleetloop", channel="r1") as local:
        sent = [Frame(0x100 + n, bytes([n])) for n in range(200)]
        for frame in sent:
            running.deliver(frame, stamp_ns=2_500_000)
        heard = [guest.recv(5.0) for _ in sent]
        assert [(m.arbitration_id, bytes(m.data)) for m in heard] == sent
        assert {m.timestamp for m in heard} == {0.0025}
        for n in range(200):
            guest.send(can.Message(arbitration_id=0x300 + n, is_extended_id=False))
        seen = []
        while len(seen) < 200:
            message = local.recv(5.0)
            if message.arbitration_id >= 0x300:
                seen.append(message.arbitration_id)
        assert seen == [0x300 + n for n in range(200)]
        assert guest.recv(0.05) is None


def test_a_guest_is_a_client_like_any_other_until_it_leaves(running: Running) -> None:
    assert running.hub.clients() == 0
    with running.open():
        assert running.until(lambda: running.hub.clients() == 1)
    assert running.until(lambda: running.hub.clients() == 0)


def test_a_wrong_password_is_refused(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="refused the login"):
        running.open(password="guessed", connect_timeout=1.0)


def test_a_bus_that_was_not_granted_is_refused_by_name(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="'bench' may open r1, not 'r2'"):
        running.open("r2")
    with running.open("r2", user="boss"):
        pass


def test_a_bus_that_is_not_there_is_refused_with_what_there_is(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="no bus 'r9' is up; buses here: r1, r2"):
        running.open("r9", user="boss")


def test_an_endpoint_alone_is_not_enough() -> None:
    with pytest.raises(can.CanInitializationError, match="give endpoint and user"):
        can.Bus(interface="fleetloop", channel="r1", endpoint="tcp/127.0.0.1:1")


def test_filters_own_messages_and_the_descriptor_work_from_afar(running: Running) -> None:
    import select

    filters = [{"can_id": 0x009, "can_mask": 0x7FF}]
    with running.open(can_filters=filters, receive_own_messages=True) as guest:
        assert running.until(lambda: running.hub.clients() == 1)
        running.deliver(Frame(0x100, b""), Frame(0x009, b"1"))
        assert guest.recv(5.0).arbitration_id == 0x009
        guest.send(can.Message(arbitration_id=0x009, is_extended_id=False, data=b"mine"))
        assert select.select([guest], [], [], 5.0)[0]
        own = guest.recv(5.0)
        assert (own.is_rx, bytes(own.data)) == (False, b"mine")


def test_the_end_of_the_run_arrives_with_its_reason(runtime_folder, tmp_path: Path) -> None:
    running = Running(tmp_path)
    guest = running.open()
    running.close("end of the run")
    with pytest.raises(can.CanOperationError, match="end of the run"):
        while guest.recv(5.0) is not None:
            pass
    guest.shutdown()


def test_a_guest_that_does_not_read_keeps_nobody_waiting(running: Running) -> None:
    with running.open(), can.Bus(interface="fleetloop", channel="r1") as local:
        for n in range(3000):
            running.deliver(Frame(0x100, n.to_bytes(4, "little")))
        last = [local.recv(5.0) for _ in range(3000)][-1]
        assert int.from_bytes(last.data, "little") == 2999
