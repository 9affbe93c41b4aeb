"""The relay: which buses a guest may open, and what a guest's packets do to others' connections."""

import random
from collections.abc import Iterator
from contextlib import contextmanager

import can
import pytest
from support.hub_running import Running

from bridge.can_bus import relay
from bridge.can_bus.packet import BYE, HELLO, MAX_BYTES, VERSION, encode_text
from bridge.frame import Frame
from bridge.network import keys
from bridge.network.client import open_client
from bridge.network.zenoh_link import ZenohLink
from configs.connections import NetworkLink


@pytest.fixture
def where() -> str:
    return "remote"


def test_a_bus_that_was_not_granted_is_refused_by_name(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="'bench' may open r1, not 'r2'"):
        running.open("r2")
    with running.open("r2", user="boss"):
        pass


def test_a_bus_that_is_not_there_is_refused_with_what_there_is(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="no bus 'r9' is up; buses here: r1, r2"):
        running.open("r9", user="boss")


def test_a_run_may_be_named_with_the_bus(running: Running) -> None:
    with running.open("test/r1"):
        pass
    with pytest.raises(can.CanInitializationError, match="no run 'other' is here but 'test'"):
        running.open("other/r1")


def test_a_guest_can_not_speak_in_anothers_name(running: Running) -> None:
    assert running.remote is not None
    settings = running.remote.settings("bench")
    network = NetworkLink("", settings["endpoint"], "bench", settings["password"])
    hello = encode_text(HELLO, "x", count=VERSION)
    with open_client(network, 5.0) as link:
        forged = keys.guest_line("boss", "f0", "r2")
        link.declare_live(f"{forged}/alive")
        link.publisher(f"{forged}/up").put(hello)
        own = keys.guest_line("bench", "0f", "r1")
        link.declare_live(f"{own}/alive")
        mouth = link.publisher(f"{own}/up")
        # One session keeps order: once its own hello arrives, the forged one would have.
        assert running.until(lambda: mouth.put(hello) or running.hub.clients())
        assert [len(bus.clients) for bus in running.hub._buses.values()] == [1, 0]


@contextmanager
def raw_session(running: Running, user: str = "bench") -> Iterator[ZenohLink]:
    """A guest's session without its line: what its own program could do with it."""
    assert running.remote is not None
    settings = running.remote.settings(user)
    network = NetworkLink("", settings["endpoint"], user, settings["password"])
    with open_client(network, 5.0) as link:
        yield link


HELLO_PACKET = encode_text(HELLO, "x", count=VERSION)


@pytest.mark.parametrize(
    "place",
    ["", "/l", "/l/r1/r1/r1", "/l/test/r1/x/y", "/*/r1", "/l/*", "/**", "/@l/r1", "/l/@relay"],
)
def test_a_hello_on_the_key_of_no_line_is_nothing_to_anybody(running: Running, place: str) -> None:
    with raw_session(running) as link, running.open("r2", "boss") as other:
        key = f"fleetloop/@guest/bench{place}"
        if "*" not in place:  # no token can be declared on a pattern
            link.declare_live(f"{key}/alive")
        for packet in (HELLO_PACKET, encode_text(BYE), b"", b"\xff" * 40):
            link.publisher(f"{key}/up").put(packet)
        with running.open() as guest:  # its session's own order: all of that was heard before
            running.deliver(Frame(2, b""))
            assert guest.recv(5.0).arbitration_id == 2
        running.deliver(Frame(3, b""), bus="r2")
        assert other.recv(5.0).arbitration_id == 3


def test_no_packets_in_whatever_order_end_anybody_elses_line(running: Running) -> None:
    dice = random.Random(7)
    said = [HELLO_PACKET, b"", b"\x00", encode_text(BYE), bytes(MAX_BYTES + 1)]
    said += [dice.randbytes(dice.randrange(1, 200)) for _ in range(20)]
    said += [
        bytes((kind,)) + dice.randbytes(dice.randrange(40)) for kind in range(8) for _ in "abc"
    ]
    with raw_session(running) as link, running.open("r2", "boss") as other:
        lines = [keys.guest_line("bench", f"l{n}", dice.choice(("r1", "r2", "no"))) for n in "0123"]
        mouths = [link.publisher(f"{line}/up") for line in lines]
        alive: set[str] = set()
        for n in range(1500):
            which = dice.randrange(len(lines))
            token = f"{lines[which]}/alive"
            if dice.random() < 0.2:
                (link.withdraw_live if token in alive else link.declare_live)(token)
                alive ^= {token}
            mouths[which].put(dice.choice(said))
            if n % 100 == 0:
                running.deliver(Frame(n, b""), bus="r2")
                assert other.recv(5.0).arbitration_id == n
        with running.open() as guest:
            running.deliver(Frame(3, b""))
            assert guest.recv(5.0).arbitration_id == 3


def test_a_line_that_fails_by_an_error_of_ours_is_the_only_one_that_ends(
    running: Running, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with running.open() as guest, running.open("r2", "boss") as other:

        def fails(self: relay.Guest) -> bool:
            if "/bench/" in self.place:
                raise RuntimeError("a bug")
            return True

        monkeypatch.setattr(relay.Guest, "push", fails)
        guest.send(can.Message(arbitration_id=1, is_extended_id=False))
        assert running.until(lambda: running.hub.clients() == 1)
        running.deliver(Frame(3, b""), bus="r2")
        assert other.recv(5.0).arbitration_id == 3
        assert "a bug" in caplog.text
        monkeypatch.undo()


def test_a_user_has_so_many_lines_and_no_more(running: Running, monkeypatch) -> None:
    monkeypatch.setattr(relay, "MAX_LINES", 2)
    refused = pytest.raises(can.CanInitializationError, match="has 2 connections open already")
    with running.open(), running.open(), running.open(user="boss"), refused:
        running.open()
    with running.open():
        pass


def test_what_is_held_of_a_user_is_bounded_and_nobody_elses(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relay, "MAX_HELD_BYTES", 100_000)
    assert running.remote is not None
    held = running.remote.relay._held
    with raw_session(running) as link, running.open("r2", "boss") as other:
        mouth = link.publisher(f"{keys.guest_line('bench', 'l', 'r1')}/up")
        for _ in range(3000):
            mouth.put(bytes(1000))
            assert held["bench"] <= 100_000
        running.deliver(Frame(3, b""), bus="r2")
        assert other.recv(5.0).arbitration_id == 3
