"""Clients with rights that say too much, too often, or don't read: the router bears them.

The router is a process of its own, as in a run: threads of a process are those of its first
session.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bridge.network import access, keys
from bridge.network.client import open_client, open_polled
from bridge.network.messages import MOST_BYTES, PathState
from bridge.network.zenoh_link import POLLED_DEPTH, ZenohLink
from configs.connections import NetworkLink
from configs.roles import AGENT

pytestmark = pytest.mark.system
RUN, ROBOTS = "test", ("r1", "r2", "r3", "r4")
HEARS = {"r1": (), "r2": ("r1",), "r3": (), "r4": ("r1", "r3")}
ROUTER = """
import json, select, sys
from pathlib import Path
from bridge.network import access
from bridge.network.router import open_router

run, robots, hears, realtime = json.loads(sys.argv[1])
plan = access.plan(run, robots, hears, robots[:1], share_period_s=0.02 if realtime else None)
with open_router(None, plan, Path(sys.argv[2])) as router:
    print(json.dumps([router.endpoint, dict(plan.passwords)]), flush=True)
    while not select.select([sys.stdin], [], [], 0.1)[0]:
        for text in router.denials.news():
            print(text, flush=True)
"""
DEAF = """
import sys, threading
import zenoh
from bridge.network.client import _login_config
from configs.connections import NetworkLink

run, endpoint, user, password, key = sys.argv[1:]
login = NetworkLink(run, endpoint, user, password)
with zenoh.open(_login_config("client", login, 10.0)) as session:  # with threads that keep it alive
    unread = session.declare_subscriber(key, zenoh.handlers.FifoChannel(1))
    print("hears", flush=True)
    threading.Event().wait()
"""


class Router:
    """A router in a process of its own."""

    def __init__(self, folder: Path, realtime: bool) -> None:
        import json

        told = json.dumps([RUN, ROBOTS, HEARS, realtime])
        self._process = subprocess.Popen(
            [sys.executable, "-c", ROUTER, told, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.endpoint, self.passwords = json.loads(self.line())

    def line(self) -> str:
        return self._process.stdout.readline()

    def login(self, robot: str) -> NetworkLink:
        user = AGENT.identity(robot)
        return NetworkLink(RUN, self.endpoint, user, self.passwords[user])

    def end(self) -> None:
        self._process.stdin.close()
        try:
            self._process.wait(10.0)
        finally:
            self._process.kill()
            self._process.wait()
            self._process.stdout.close()


@pytest.fixture
def router(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Router]:
    started = Router(tmp_path, realtime=getattr(request, "param", False))
    yield started
    started.end()


@contextmanager
def talking(router: Router, *, polled: bool = True) -> Iterator[tuple[ZenohLink, ZenohLink]]:
    """r1 and r2, who hears r1, once that works."""
    hearing = open_polled if polled else open_client
    with open_client(router.login("r1"), 10.0) as r1, hearing(router.login("r2"), 10.0) as r2:
        key = keys.path(RUN, "r1")
        r2.subscribe(key, "path")
        mouth = r1.publisher(key)
        deadline = time.monotonic() + 20.0
        while r2.receive(0.05) is None:
            assert time.monotonic() < deadline
            mouth.put(b"hello")
        yield r1, r2


def last(r2: ZenohLink, word: bytes) -> list[bytes]:
    """All that arrives up to a word."""
    found = []
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        arrival = r2.receive(1.0)
        if arrival is not None:
            found.append(arrival.payload)
            if arrival.payload == word:
                return found
    raise AssertionError(f"{word!r} did not come")


def test_what_is_longer_than_anything_honest_goes_no_further_than_the_router(
    router: Router,
) -> None:
    with talking(router, polled=False) as (r1, r2):
        mouth = r1.publisher(keys.path(RUN, "r1"))
        most = MOST_BYTES["path"]
        for size in (most, most + 1, 100_000, 10_000_000):
            mouth.put(bytes(size))
        mouth.put(b"after")
        assert [len(payload) for payload in last(r2, b"after") if payload != b"hello"] == [most, 5]


def test_an_honest_message_is_far_below_its_limit() -> None:
    longest = PathState(-(2**62), -(2**62), -1e300, -1e300)
    assert 2 * len(longest.encode()) < MOST_BYTES["path"]


@pytest.mark.parametrize("router", [True], indirect=True)
def test_in_real_time_a_flood_is_thinned_out_at_the_router(router: Router) -> None:
    with talking(router, polled=False) as (r1, r2):
        mouth = r1.publisher(keys.path(RUN, "r1"))
        began, heard = time.monotonic(), 0
        for _ in range(20_000):
            mouth.put(b"flood")
        while True:
            mouth.put(b"after")
            arrival = r2.receive(0.02)
            heard += arrival is not None
            if arrival is not None and arrival.payload == b"after":
                break
            assert time.monotonic() - began < 20.0
        took_s = time.monotonic() - began
    assert heard <= access.MOST_PER_PERIOD / 0.02 * took_s + 2


def test_a_hearer_keeps_only_the_last_of_a_flood(router: Router) -> None:
    with talking(router) as (r1, r2):
        key, all_came = keys.path(RUN, "r1"), threading.Event()
        r2.each(key, lambda payload: all_came.set() if payload == b"after" else None)
        mouth = r1.publisher(key, express=False)
        for _ in range(50_000):
            mouth.put(b"flood")
        mouth.put(b"after")
        assert all_came.wait(30.0)
        assert len(last(r2, b"after")) <= POLLED_DEPTH + 1


def test_a_key_that_is_flooded_does_not_keep_a_hearer_from_the_others(router: Router) -> None:
    with (
        open_client(router.login("r1"), 10.0) as r1,
        open_client(router.login("r3"), 10.0) as r3,
        open_polled(router.login("r4"), 10.0) as r4,
    ):
        r4.subscribe(keys.path(RUN, "r1"), "r1")
        r4.subscribe(keys.path(RUN, "r3"), "r3")
        flooder, other = r1.publisher(keys.path(RUN, "r1")), r3.publisher(keys.path(RUN, "r3"))
        over = threading.Event()

        def flood() -> None:
            while not over.is_set():
                flooder.put(b"flood")

        speaker = threading.Thread(target=flood)
        speaker.start()
        try:
            heard: list[str] = []
            deadline = time.monotonic() + 20.0
            while heard.count("r3") < 10 or "r1" not in heard:
                assert time.monotonic() < deadline, set(heard)
                other.put(b"x")
                if (arrival := r4.receive(0.01)) is not None:
                    heard.append(arrival.tag)
        finally:
            over.set()
            speaker.join(20.0)


def test_a_hearer_that_does_not_read_is_cut_off_and_named_and_others_hardly_wait(
    router: Router,
) -> None:
    login, key = router.login("r2"), keys.path(RUN, "r1")
    words = (RUN, login.endpoint, login.user, login.password, key)
    deaf = subprocess.Popen([sys.executable, "-c", DEAF, *words], stdout=subprocess.PIPE)
    try:
        assert deaf.stdout.readline() == b"hears\n"
        with (
            open_client(router.login("r1"), 10.0) as r1,
            open_client(router.login("r3"), 10.0) as r3,
            open_client(router.login("r4"), 10.0) as r4,
        ):
            r4.subscribe(keys.path(RUN, "r3"), "r3")
            mouth, other = r1.publisher(key, express=False), r3.publisher(keys.path(RUN, "r3"))
            over = threading.Event()

            def flood() -> None:
                while not over.is_set():
                    mouth.put(bytes(100))

            speaker = threading.Thread(target=flood)
            speaker.start()
            try:
                said = router.line()
            finally:
                over.set()
                speaker.join(20.0)
            heard = threading.Event()
            deadline = time.monotonic() + 20.0
            while not heard.is_set() and time.monotonic() < deadline:
                other.put(b"x")
                if r4.receive(0.05) is not None:
                    heard.set()
            assert heard.is_set()
        assert said.startswith("cut off 'agent-r2' from 127.0.0.1: it did not read")
    finally:
        os.kill(deaf.pid, signal.SIGKILL)
        deaf.wait()
        deaf.stdout.close()
