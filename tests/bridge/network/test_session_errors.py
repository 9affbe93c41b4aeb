"""Causes of a failed session with a router: reported at once and by name."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from support.addresses import free_port
from support.certificates import certificates

from bridge.network import access
from bridge.network.client import open_client
from bridge.network.router import RouterLink, open_router
from configs.connections import NetworkLink, Outside
from configs.errors import InfrastructureError
from configs.tls import TlsFiles

RUN = "test"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("certificates")
    certificates(made, ("router", "agent-r1"))
    certificates(made, ("stranger",), authority="other")
    return made


def files(folder: Path, name: str, authority: str = "ca") -> TlsFiles:
    return TlsFiles(
        ca=folder / f"{authority}.pem",
        certificate=folder / f"{name}.pem",
        private_key=folder / f"{name}.key",
    )


@pytest.fixture
def plan() -> access.AccessPlan:
    return access.plan(RUN, ("r1",), {"r1": ()}, ("r1",), guests={"agent-r1": "word"})


@pytest.fixture
def outside(folder: Path) -> Outside:
    return Outside(f"tls/localhost:{free_port()}", files(folder, "router"))


@pytest.fixture
def router(plan: access.AccessPlan, outside: Outside, tmp_path: Path) -> Iterator[RouterLink]:
    with open_router(None, plan, tmp_path, outside) as link:
        yield link


def failure(link: NetworkLink, within_s: float) -> str:
    """The cause of a session that did not open."""
    with pytest.raises(InfrastructureError) as caught:
        open_client(link, within_s)
    return str(caught.value)


def refusal(link: NetworkLink) -> str:
    """The cause, reported at once: of a wait that was used up the text has the length."""
    said = failure(link, 60.0)
    assert "within 60 s" not in said
    return said


@pytest.mark.parametrize(("user", "word"), [("agent-r1", "wrong"), ("stranger", "word")])
def test_a_wrong_login_is_refused_at_once_and_by_whom(
    router: RouterLink, user: str, word: str
) -> None:
    said = refusal(NetworkLink(RUN, router.endpoint, user, word))
    assert said == (
        f"{user}: no session with the router at {router.endpoint}: it refused the login: not the"
        f" password or present certificate of {user!r}, or no identity of its run"
    )


def test_a_certificate_of_another_authority_is_refused_at_once_and_by_whom(
    router: RouterLink, outside: Outside, folder: Path
) -> None:
    tls = files(folder, "stranger")
    said = refusal(NetworkLink(RUN, outside.endpoint, "agent-r1", "word", tls))
    assert f"the router at {outside.endpoint}: it refused the certificate of 'agent-r1'" in said


def test_a_router_of_another_authority_is_refused_here(
    router: RouterLink, outside: Outside, folder: Path
) -> None:
    tls = files(folder, "agent-r1", authority="other")
    said = refusal(NetworkLink(RUN, outside.endpoint, "agent-r1", "word", tls))
    assert "its certificate is not signed by the authority in ca, so it was refused here" in said


def test_a_router_that_is_not_there_yet_is_waited_for(
    plan: access.AccessPlan, tmp_path: Path
) -> None:
    nowhere = NetworkLink(RUN, f"tcp/127.0.0.1:{free_port()}", "agent-r1", "word")
    said = failure(nowhere, 0.5)
    assert said.endswith("within 0.5 s: no program listens there (Connection refused)")


def test_who_listens_and_says_nothing_or_hangs_up_is_told_apart(outside: Outside) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        login = NetworkLink(RUN, f"tcp/127.0.0.1:{silent.getsockname()[1]}", "agent-r1", "word")
        assert failure(login, 0.5).endswith("no answer from there")


@contextmanager
def half_open(endpoint: str, count: int, word: bytes) -> Iterator[None]:
    """So many connections that say no more than `word`."""
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    with ExitStack() as held:
        for _ in range(count):
            connection = held.enter_context(socket.create_connection((host, int(port)), 5.0))
            connection.sendall(word)
        yield


def logs_in(login: NetworkLink) -> bool:
    with open_client(login, 5.0):
        return True


@pytest.mark.parametrize("word", [b"", b"x"])
def test_connections_that_go_no_further_keep_nobody_out(
    router: RouterLink, plan: access.AccessPlan, word: bytes
) -> None:
    login = NetworkLink(RUN, router.endpoint, "agent-r1", "word")
    with half_open(router.endpoint, 150, word):  # Zenoh alone takes 100, for ten seconds
        assert logs_in(login)


def test_silent_connections_to_a_listener_with_tls_keep_nobody_out(
    router: RouterLink, outside: Outside, folder: Path
) -> None:
    tls = files(folder, "agent-r1")
    with half_open(outside.endpoint, 150, b""):
        assert logs_in(NetworkLink(RUN, outside.endpoint, "agent-r1", "word", tls))


def test_whoever_means_it_gets_in_though_more_wait_than_may(
    plan: access.AccessPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bridge.network.router_config.MOST_PENDING", 20)
    with open_router(None, plan, tmp_path) as router, half_open(router.endpoint, 60, b"x"):
        assert logs_in(NetworkLink(RUN, router.endpoint, "agent-r1", "word"))


def test_plain_tcp_to_a_listener_with_tls_is_named(router: RouterLink, outside: Outside) -> None:
    plain = outside.endpoint.replace("tls/", "tcp/")
    said = failure(NetworkLink(RUN, plain, "agent-r1", "word"), 0.5)
    assert "or tcp/ instead of tls/" in said


@pytest.mark.parametrize(
    ("endpoint", "said"),
    [
        ("tcp/192.0.2.1:7447", "192.0.2.1:7447 is no address of this machine"),
        ("tcp/nosuch.invalid:7447", "no such host (Name or service not known)"),
        ("tls/127.0.0.1:7447", "tls/ needs certificates: network.certificates of a deployment"),
    ],
)
def test_why_nobody_can_listen_there_is_told_apart(
    plan: access.AccessPlan, tmp_path: Path, endpoint: str, said: str
) -> None:
    with (
        pytest.raises(InfrastructureError, match=rf"^can't listen at {endpoint}: ") as caught,
        open_router(endpoint, plan, tmp_path),
    ):
        pass
    assert str(caught.value).endswith(said)
