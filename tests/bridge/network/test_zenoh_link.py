"""Sessions: how they are opened, and that whatever becomes of them never stops their process."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bridge.network import access, keys
from bridge.network.client import open_client
from bridge.network.link import Publisher
from bridge.network.router import open_router
from bridge.network.session import few_threads
from bridge.network.zenoh_link import heard
from configs.connections import NetworkLink
from configs.roles import AGENT, VIEWER

DROPS = """
import gc, itertools, sys, threading
from pathlib import Path
from bridge.network import access
from bridge.network import keys
from bridge.network.client import open_client
from bridge.network.router import open_router
from configs.connections import NetworkLink
from configs.roles import AGENT

folder = Path(sys.argv[1])
plan = access.plan("test", ("r1",), {"r1": ()}, ("r1",))
passing = access.plan("other", ("r1",), {"r1": ()}, ("r1",))
heard = itertools.count()
over = threading.Event()

def fails():
    with open_router(None, passing, folder) as link:
        link.subscribe(keys.report("other", "plant"), "report")
        raise RuntimeError("with the session in its traceback")

def opens_and_closes():
    try:
        fails()
    except RuntimeError as error:
        error.itself = error  # only the garbage collector frees it, in whatever thread

with open_router(None, plan, folder) as lasting:
    lasting.each(keys.path("test", "r1"), lambda _: next(heard))
    user = AGENT.identity("r1")
    login = NetworkLink("test", lasting.endpoint, user, plan.passwords[user])
    with open_client(login, 10.0) as client:
        mouth = client.publisher(keys.path("test", "r1"))
        def say():
            while not over.is_set():
                mouth.put(b"x")
        speaker = threading.Thread(target=say)
        speaker.start()
        try:
            for n in range(30):
                with open_router(None, passing, folder):
                    pass
                opens_and_closes()
                collector = threading.Thread(target=gc.collect)
                collector.start()
                collector.join()
        finally:
            over.set()
            speaker.join()
print("heard" if next(heard) else "silence")
"""


def ends(program: str, *args: str, within_s: float = 60.0) -> str:
    """What a program of its own prints until it ends well; the bound is not one of its own."""
    done = subprocess.run(
        [sys.executable, "-c", program, *args],
        timeout=within_s,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.system
def test_sixty_routers_come_and_go_while_another_session_calls_python(tmp_path: Path) -> None:
    assert ends(DROPS, str(tmp_path)) == "heard\n"


NO_IPV4 = "ip link set lo up && ip addr del 127.0.0.1/8 dev lo"
ROUTER = """
import sys
from pathlib import Path
from bridge.network import access
from bridge.network.client import open_client
from bridge.network.router import open_router
from configs.connections import NetworkLink
from configs.roles import AGENT
from configs.errors import InfrastructureError
plan = access.plan("test", ("r1",), {"r1": ()}, ("r1",))
try:
    with open_router(None, plan, Path(sys.argv[1])) as router:
        login = NetworkLink("test", router.endpoint, "plant", plan.passwords["plant"])
        with open_client(login, 10.0):
            print(router.endpoint)
except InfrastructureError as error:
    print(error)
"""


def may_have_networks_of_its_own() -> bool:
    tried = subprocess.run(["unshare", "-n", "ip", "link", "set", "lo", "up"], capture_output=True)
    return tried.returncode == 0


@pytest.mark.skipif(not may_have_networks_of_its_own(), reason="no right to a network namespace")
@pytest.mark.parametrize(
    ("first", "said"),
    [(NO_IPV4, r"tcp/\[::1\]:\d+\n"), ("true", "no loopback address .*: ip link set lo up\n")],
)
def test_without_ipv4_the_loopback_of_ipv6_serves(tmp_path: Path, first: str, said: str) -> None:
    shell = f'{first} && exec "$0" -c "$1" "$2"'
    done = subprocess.run(
        ["unshare", "-n", "bash", "-c", shell, sys.executable, ROUTER, str(tmp_path)],
        timeout=60,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert re.fullmatch(said, done.stdout), done.stderr


def test_threads_may_open_their_first_sessions_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ZENOH_RUNTIME", raising=False)
    one, other = few_threads("one"), few_threads("other")
    with one:
        del os.environ["ZENOH_RUNTIME"]  # the other looked before this one had set it
        with other:
            assert os.environ["ZENOH_RUNTIME"] == "other"
    assert "ZENOH_RUNTIME" not in os.environ


def test_a_publisher_is_heard_while_somebody_subscribes(tmp_path: Path) -> None:
    plan = access.plan("test", ("r1",), {"r1": ()}, ("r1",))
    agent, viewer = AGENT.identity("r1"), VIEWER.identity()
    key = keys.telemetry("test", "r1")

    def await_heard(publisher: Publisher, *, expected: bool) -> bool:
        deadline_s = time.monotonic() + 20.0
        while heard(publisher) is not expected and time.monotonic() < deadline_s:
            os.sched_yield()
        return heard(publisher)

    with open_router(None, plan, tmp_path) as router:
        at = router.endpoint
        with open_client(NetworkLink("test", at, agent, plan.passwords[agent]), 10.0) as link:
            publisher = link.publisher(key)
            assert not heard(publisher)
            with open_client(NetworkLink("test", at, viewer, plan.passwords[viewer]), 10.0) as eye:
                eye.subscribe(key, "rows")
                assert await_heard(publisher, expected=True)
            assert not await_heard(publisher, expected=False)
