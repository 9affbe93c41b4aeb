"""Who says far more than the schedule allows is cut off, and nobody else."""

import select
import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from support.controller_rows import ROW

from bridge.network.flood_guard import (
    BURST_MESSAGES,
    BYTES_PER_TICK,
    MESSAGES_PER_S,
    MESSAGES_PER_TICK,
    Bucket,
    FloodGuard,
    Received,
    deafen,
)
from bridge.network.messages import PathState


def test_what_the_schedule_allows_never_runs_over() -> None:
    """Five thousand ticks a second with a path state and a row each, and a burst now and then."""
    bucket, said = Bucket(Received(0, 0)), Received(0, 0)
    for _ in range(1000):
        said = Received(said.messages + 1000 + 10, said.size + 1000 * 400)
        assert not bucket.fill(said, ticks=1000, seconds=0.2)


def test_a_stall_and_what_piled_up_meanwhile_does_not_run_over() -> None:
    bucket = Bucket(Received(0, 0))
    assert not bucket.fill(Received(0, 0), ticks=0, seconds=5.0)
    assert not bucket.fill(Received(1500, 500_000), ticks=0, seconds=0.2)
    assert not bucket.fill(Received(3000, 1_000_000), ticks=3000, seconds=0.2)


def test_a_flood_runs_over_within_a_second_whatever_its_shape() -> None:
    small, large = Bucket(Received(0, 0)), Bucket(Received(0, 0))
    assert any(small.fill(Received(2000 * n, 0), 10, 0.2) for n in range(1, 6))
    assert any(large.fill(Received(n, n << 20), 10, 0.2) for n in range(1, 6))


def test_forty_thousand_a_second_is_beyond_what_any_fast_run_allows() -> None:
    assert 3 * (MESSAGES_PER_S + MESSAGES_PER_TICK * 2000) < 40_000
    assert 2.5 * (ROW.size + len(PathState(2**40, 2**62, 1e3, 0.6).encode())) < BYTES_PER_TICK


class Pair:
    """A connection between two ends of this process; the first is the router's."""

    def __init__(self, listener: socket.socket) -> None:
        self.theirs = socket.create_connection(listener.getsockname()[:2])
        self.ours, _ = listener.accept()
        self.ours.setblocking(False)
        self.theirs.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        host, port = self.theirs.getsockname()[:2]
        self.peer = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"

    def say(self, messages: int) -> None:
        for _ in range(messages):
            self.theirs.send(b"x" * 50)
            self.ours.recv(1 << 16)

    def is_heard(self) -> bool:
        """Whether what they say now arrives, within a bound."""
        self.theirs.send(b"x")
        arrives, _, _ = select.select([self.ours], [], [], 0.3)
        return bool(arrives)


@pytest.fixture(params=[socket.AF_INET, socket.AF_INET6])
def pairs(request: pytest.FixtureRequest) -> Iterator[tuple[Pair, Pair]]:
    host = "127.0.0.1" if request.param == socket.AF_INET else "::1"
    with ExitStack() as stack:
        try:
            listener = stack.enter_context(socket.create_server((host, 0), family=request.param))
        except OSError:
            assert host == "::1"
            pytest.skip("no IPv6 on this machine")
        both = Pair(listener), Pair(listener)
        for pair in both:
            stack.enter_context(pair.ours)
            stack.enter_context(pair.theirs)
        yield both


def test_from_the_connection_that_floods_nothing_more_is_taken_and_the_other_is_heard(
    pairs,
) -> None:
    flooder, honest = pairs
    guard, users = FloodGuard(), {flooder.peer: "agent-r1", honest.peer: "agent-r1"}
    assert guard.look(users, 0, 0.0) == []
    flooder.say(2 * BURST_MESSAGES)
    honest.say(10)
    assert guard.look(users, 0, 0.2) == [flooder.peer]
    assert not flooder.is_heard()
    assert honest.is_heard()
    assert guard.look(users, 0, 0.4) == []


def test_who_comes_again_after_he_was_cut_off_is_not_heard(pairs) -> None:
    again, honest = pairs
    deafen(again.peer)
    assert not again.is_heard()
    assert honest.is_heard()


def test_who_is_no_controller_is_not_looked_at(pairs) -> None:
    plant, controller = pairs
    guard, users = FloodGuard(), {controller.peer: "agent-r1"}
    guard.look(users, 0, 0.0)
    plant.say(2 * BURST_MESSAGES)
    assert guard.look(users, 0, 0.2) == []
    assert plant.is_heard()
