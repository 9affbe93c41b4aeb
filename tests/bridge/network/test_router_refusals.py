"""Refused logins and denied puts leave a line with whom and how often, from a router's own log."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.certificates import certificates

from bridge.network.router_refusals import MOST, Denials

PROLOGUE = """
import socket, sys, threading, time
from pathlib import Path
from bridge.network import access
from bridge.network import keys
from bridge.network.client import open_client
from bridge.network.router import open_router
from configs.connections import NetworkLink, Outside
from configs.errors import InfrastructureError
from configs.tls import TlsFiles

folder = Path(sys.argv[1])
with socket.socket() as probe:
    probe.bind(("127.0.0.1", 0))
    port = probe.getsockname()[1]

def files(name):
    return TlsFiles(
        ca=folder / "ca.pem",
        certificate=folder / f"{name}.pem",
        private_key=folder / f"{name}.key",
    )

tls = sys.argv[2] == "tls"
words = ("agent-r1", "agent-r2") if tls else ("one", "two")
plan = access.plan("t", ("r1", "r2"), {"r1": (), "r2": ()}, ("r1",), certified=tls,
                   guests=dict(zip(("agent-r1", "agent-r2"), words)))
outside = Outside(f"{sys.argv[2]}/localhost:{port}", files("router") if tls else None)

def login(user, word, certificate=None):
    return open_client(NetworkLink("t", outside.endpoint, user, word,
                                   files(certificate or user) if tls else None), 5.0)

def denied(user, word, certificate=None):
    try:
        login(user, word, certificate).close()
    except InfrastructureError:
        pass

def said(router):  # after its end: then all of its log has been read
    for note in router.denials.notes():
        print(note)

def until(holds):
    pause, deadline = threading.Event(), time.monotonic() + 10.0
    while not holds():
        assert time.monotonic() < deadline
        pause.wait(0.005)
"""
LOGINS = """
with open_router(None, plan, folder, outside) as router:
    denied("agent-r1", "wrong")
    denied("a\\x1b[31mb", "wrong")
    with login("agent-r2", "two"):
        pass
said(router)
print(router.denials.logins_of("agent-r1"))
"""
PUTS = """
with open_router(None, plan, folder, outside) as router:
    router.subscribe(keys.path("t", "r1"), "own")
    with login("agent-r1", "one") as link:
        link.subscribe(keys.path("t", "r2"), "secret")
        forbidden = keys.path("t", "r2"), keys.order("t", "plant"), "anything/at/all"
        # Without publishers: one that is told that nobody listens sends nothing.
        def put():
            for key in forbidden:
                link._session.put(key, b"forged")
        until(lambda: put() or len(router.denials.notes()) > len(forbidden))
        own = link.publisher(keys.path("t", "r1"))
        until(lambda: own.put(b"honest") or router.receive(0.0))
said(router)
"""
CERTIFICATES = """
with open_router(None, plan, folder, outside) as router:
    router.subscribe(keys.path("t", "r2"), "path")
    with login("agent-r2", "agent-r2", certificate="agent-r1") as link:
        mouth = link.publisher(keys.path("t", "r2"))
        until(lambda: mouth.put(b"by r1") or len(router.denials.notes()) > 1)
    denied("agent-r2", "agent-r2", certificate="stranger")
    with login("agent-r2", "agent-r2") as link:
        mouth = link.publisher(keys.path("t", "r2"))
        while (heard := router.receive(0.05)) is None:
            mouth.put(b"by r2")
        assert heard.payload == b"by r2"
said(router)
"""


def notes(program: str, folder: Path, scheme: str, **env: str) -> tuple[list[str], str]:
    """What a program of its own prints, whose log is its own: (standard output, error)."""
    done = subprocess.run(
        [sys.executable, "-c", PROLOGUE + program, str(folder), scheme],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | env,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr


@pytest.mark.parametrize("asked", ["", "info", "zenoh=off"])
def test_a_refused_login_leaves_who_from_where_and_why(tmp_path: Path, asked: str) -> None:
    said, _ = notes(LOGINS, tmp_path, "tcp", RUST_LOG=asked)
    # A client asks once more for the reason; a slow answer to it makes one more attempt.
    first, second, of_mine = said
    who = "refused the login of 'agent-r1' from 127.0.0.1: wrong password"
    assert re.fullmatch(rf"{who} \([2-9] times\)", first)
    other = "refused the login of 'a\N{REPLACEMENT CHARACTER}[31mb' from 127.0.0.1: no identity of"
    assert re.fullmatch(rf"{re.escape(other)} this run \([2-9] times\)", second)
    assert ast.literal_eval(of_mine) == [first]


def test_a_denied_put_leaves_who_and_what_and_an_allowed_one_nothing(
    tmp_path: Path,
) -> None:
    said, _ = notes(PUTS, tmp_path, "tcp")
    listening, *puts = (re.sub(r" \(\d+ times\)$", "", note) for note in sorted(said))
    assert listening == (
        "denied to 'agent-r1' from 127.0.0.1: listening on fleetloop/t/robot/r2/path"
    )
    put = "denied to 'agent-r1' from 127.0.0.1: put on "
    assert puts == [
        f"{put}anything/at/all",
        f"{put}fleetloop/t/@order/plant",
        f"{put}fleetloop/t/robot/r2/path",
    ]


def test_a_certificate_of_somebody_else_may_connect_and_nothing_more_and_both_are_named(
    tmp_path: Path,
) -> None:
    certificates(tmp_path, ("router", "agent-r1", "agent-r2"))
    certificates(tmp_path, ("stranger",), authority="other")
    said, _ = notes(CERTIFICATES, tmp_path, "tls")
    assert said[0] == (
        "'agent-r2' from 127.0.0.1 came with the certificate of 'agent-r1': may neither say nor"
        " hear anything"
    )
    denied = (
        r"denied to 'agent-r2' from 127.0.0.1: put on fleetloop/t/robot/r2/path( \(\d+ times\))?"
    )
    assert any(re.fullmatch(denied, note) for note in said)
    assert any(note.startswith("refused a connection over TLS: ") for note in said)


def test_the_log_that_a_user_asks_for_goes_to_standard_error_without_what_is_ours(
    tmp_path: Path,
) -> None:
    said, log = notes(LOGINS, tmp_path, "tcp", RUST_LOG="info")
    assert len(said) == 3
    assert "Zenoh can be reached at: tcp/" in log
    assert "Establishment Accept" not in log


def test_no_line_whatever_breaks_the_reader_and_what_it_keeps_is_bounded() -> None:
    denials = Denials()
    head = "2026-11-26T17:19:09.991607Z TRACE acc-0 ThreadId(05) "
    accept = head + "zenoh_transport::unicast::establishment::accept: "
    for junk in ("", "x", head, accept, f"{accept}Establishment Accept OpenSyn: a => tcp/b. Rec"):
        denials.process(junk)
    for n in (*range(3 * MOST), 7, 7):
        user = f"u{n}".encode()
        login = bytes((0x42, len(user) + 1, len(user))) + user
        slices = ", ".join(f"{byte:02x}" for byte in login)
        syn = f"Establishment Accept OpenSyn: tcp/a => tcp/h:{n}. Received: "
        denials.process(f"{accept}{syn}ext_auth: Some(ZExtZBuf {{ slices: [[{slices}]] }})")
        denials.process(f"{accept}UsrPwd extension - Recv OpenSyn. Invalid user. at x.rs:1.")
    assert "refused the login of 'u7' from h: no identity of this run (3 times)" in denials.notes()
    assert "refused the login of 'u8' from h: no identity of this run" in denials.notes()
    assert len(denials.notes()) == MOST + 1
    assert denials.notes()[-1] == f"refused much else ({2 * MOST} times)"
    assert denials.news() and not denials.news()


DENIED = """
from bridge.network.router_refusals import MOST_DENIED
with open_router(None, plan, folder, outside) as router:
    router.subscribe(keys.path("t", "r2"), "r2")
    with login("agent-r1", "one") as flooder, login("agent-r2", "two") as other:
        def flood():
            for _ in range(100):
                flooder._session.put("anything/at/all", b"flood")
        until(lambda: flood() or router.denials.flooders)
        with login("agent-r1", "one"):
            until(lambda: any(note.startswith("turned away") for note in router.denials.notes()))
        mouth = other.publisher(keys.path("t", "r2"))
        until(lambda: mouth.put(b"honest") or router.receive(0.0))
said(router)
counts = router.denials.counts()
print(counts["flood"], counts["rights"]["agent-r1"] >= MOST_DENIED)
"""


def test_who_goes_on_with_what_he_may_not_do_is_cut_off_and_the_others_go_on(tmp_path) -> None:
    lines, _ = notes(DENIED, tmp_path, "tcp")
    cut = "cut off 'agent-r1' from 127.0.0.1: it went on with what it may not do"
    assert cut in lines
    assert lines[-1] == "{'agent-r1': 2} True"


FLOODS = """
with open_router(None, plan, folder, outside) as router:
    with login("agent-r1", "one"):
        until(lambda: router.denials.peers("agent-r1"))
    router.denials.note_flood("agent-r1", "127.0.0.1:1")
    with login("agent-r1", "one") as again, login("agent-r2", "two") as other:
        for robot in ("r1", "r2"):
            router.subscribe(keys.path("t", robot), robot)
        until(lambda: any(note.startswith("turned away") for note in router.denials.notes()))
        again.publisher(keys.path("t", "r1")).put(b"flood")
        other.publisher(keys.path("t", "r2")).put(b"honest")
        print(router.receive(5.0).tag, router.receive(0.3))
said(router)
"""


def test_who_was_cut_off_for_a_flood_is_turned_away_when_he_comes_again(tmp_path) -> None:
    (heard, *lines), _ = notes(FLOODS, tmp_path, "tcp")
    assert heard == "r2 None"
    assert "turned away 'agent-r1' from 127.0.0.1: it was cut off before" in lines
