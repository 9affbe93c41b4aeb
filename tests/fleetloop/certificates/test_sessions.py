"""Certificates at a router: a deployment's folder says whom it lets in, over real sessions."""

import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from support.addresses import free_port
from support.clocks import ManualClock

from bridge.network import keys
from bridge.network.client import open_client
from bridge.network.router import RouterLink, open_router
from bridge.process.clock import SYSTEM_CLOCK
from configs.connections import NetworkLink
from configs.deployment import Deployment, check_deployment
from configs.errors import InfrastructureError, ScenarioError
from configs.loading import load
from configs.tls import files_in
from fleetloop.certificates.folder import CertificateFolder
from fleetloop.launch import placement

pytestmark = pytest.mark.system
SCENARIO = load("two_robots_100hz")
RUN = SCENARIO.name
DAY_NS = 86_400 * 10**9


@pytest.fixture
def base(tmp_path: Path) -> CertificateFolder:
    """On the machine with the router; both robots are elsewhere, and a bench may have a bus."""
    made = CertificateFolder(tmp_path / "base")
    made.create(["localhost"], days=30, authority_days=300)
    for identity in ("agent-r1", "agent-r2"):
        made.issue(identity, days=30)
    made.issue("bench", days=30, guest=True)
    return made


def deployment(certificates: Path, port: int) -> Deployment:
    network = {
        "endpoint": f"tls/localhost:{port}",
        "certificates": str(certificates),
        "guests": {"bench": ["*"]},
    }
    data = {"roles": ["plant", "recorder"], "network": network}
    return check_deployment("where.toml", data, SCENARIO, Path())


def robot(base: CertificateFolder, identity: str, name: str = "") -> Path:
    """Its machine: a folder with its files of now, perhaps under the name of another."""
    folder = base.path.parent / f"{identity} as {name}"
    folder.mkdir()
    shutil.copy(base.path / "ca.pem", folder)
    for suffix in (".pem", ".key"):
        shutil.copy(base.path / f"{identity}{suffix}", folder / f"{name or identity}{suffix}")
    return folder


@contextmanager
def router(base: CertificateFolder) -> Iterator[tuple[RouterLink, int]]:
    port = free_port()
    where = deployment(base.path, port)
    placement.check_credentials(SCENARIO, where)
    plan = placement.access_plan(SCENARIO, where, RUN)
    with open_router(None, plan, base.path.parent, placement.outside(where)) as link:
        yield link, port


def joins(certificates: Path, port: int, identity: str = "agent-r2"):
    role = identity.replace("-", "/", 1)
    network = placement.network_link(SCENARIO, deployment(certificates, port), role)
    return open_client(network, 5.0)


def until(holds: Callable[[], bool], act: Callable[[], object] = lambda: None) -> None:
    pause, deadline = threading.Event(), SYSTEM_CLOCK.monotonic_s() + 10.0
    while not holds():
        assert SYSTEM_CLOCK.monotonic_s() < deadline
        act()
        pause.wait(0.01)


def test_a_robot_with_its_certificate_is_heard_and_so_it_is_with_a_renewed_one(base) -> None:
    machine = robot(base, "agent-r2")
    base.renew("agent-r2", days=60)  # the one on the robot stays good
    with router(base) as (link, port), joins(machine, port) as r2:
        link.subscribe(keys.path(RUN, "r2"), "path")
        mouth = r2.publisher(keys.path(RUN, "r2"))
        until(lambda: link.receive(0.0) is not None, lambda: mouth.put(b"here"))
        assert link.denials.counts() == {}


def test_a_revoked_certificate_is_refused_at_login_and_its_successor_comes_in(base) -> None:
    old = robot(base, "agent-r2")
    base.revoke("agent-r2")
    base.issue("agent-r2", days=30)
    with router(base) as (link, port):
        with pytest.raises(InfrastructureError, match="not the password or present certificate"):
            joins(old, port)
        until(lambda: bool(link.denials.counts()))
        with joins(base.path, port):
            pass
        assert set(link.denials.counts()) == {"login"}
        assert set(link.denials.counts()["login"]) == {"agent-r2"}
        assert (
            "refused the login of 'agent-r2' from 127.0.0.1: its certificate is revoked: it is that"
            " of 'agent-r2'" in link.denials.notes()[0]
        )


def test_a_revoked_certificate_that_lies_about_itself_has_no_right_at_all(base) -> None:
    old = robot(base, "agent-r2")
    base.revoke("agent-r2")
    base.issue("agent-r2", days=30)
    with router(base) as (link, port):
        login = NetworkLink(
            RUN, f"tls/localhost:{port}", "agent-r2", "agent-r2#2", files_in(old, "agent-r2")
        )
        link.subscribe(keys.path(RUN, "r2"), "path")
        with open_client(login, 5.0) as liar:
            mouth = liar.publisher(keys.path(RUN, "r2"))
            until(
                lambda: "certificate" in link.denials.counts(), lambda: mouth.put(b"by a revoked")
            )
        assert link.receive(0.2) is None
        assert set(link.denials.counts()["certificate"]) == {"agent-r2"}


def test_a_revoked_role_stops_the_start_and_a_revoked_guest_is_kept_out(base) -> None:
    base.revoke("bench")
    where = deployment(base.path, 7447)
    assert placement.kept_out(where) == {"bench": "its certificate is revoked"}
    plan = placement.access_plan(SCENARIO, where, RUN)
    assert "bench" not in plan.rights
    assert "agent-r2" in plan.rights
    base.revoke("agent-r2")
    with pytest.raises(ScenarioError, match=r"^network\.certificates: .*agent-r2\.pem: is revoked"):
        placement.check_credentials(SCENARIO, where)


def test_a_robot_that_speaks_under_another_name_is_refused_with_both_names(base) -> None:
    machine = robot(base, "agent-r1")
    with router(base) as (link, port):
        link.subscribe(keys.path(RUN, "r2"), "path")
        tls = files_in(machine, "agent-r1")
        login = NetworkLink(RUN, f"tls/localhost:{port}", "agent-r2", "agent-r2", tls)
        with open_client(login, 5.0) as impostor:
            mouth = impostor.publisher(keys.path(RUN, "r2"))
            until(lambda: bool(link.denials.counts()), lambda: mouth.put(b"by r1"))
        assert link.receive(0.2) is None
        assert set(link.denials.counts()["certificate"]) == {"agent-r1"}
        assert any(
            "'agent-r2' from 127.0.0.1 came with the certificate of 'agent-r1'" in note
            for note in link.denials.notes()
        )
    # Our own programs don't even try.
    with pytest.raises(
        ScenarioError, match=r"of 'agent-r1' \(its common name\), not of 'agent-r2'"
    ):
        joins(robot(base, "agent-r1", "agent-r2"), port)


def test_an_expired_certificate_and_one_of_another_authority_are_refused(base, tmp_path) -> None:
    yesterday = ManualClock(SYSTEM_CLOCK.wall_ns() - 40 * DAY_NS)
    CertificateFolder(base.path, clock=yesterday).renew("agent-r2", days=39)
    late = robot(base, "agent-r2")
    base.renew("agent-r2", days=30)
    other = CertificateFolder(tmp_path / "other")
    other.create(["localhost"], days=30, authority_days=300)
    other.issue("agent-r2", days=30)
    with router(base) as (link, port):
        endpoint = f"tls/localhost:{port}"
        for files, said in (
            (files_in(late, "agent-r2"), "CertificateExpired"),
            (
                replace(files_in(other.path, "agent-r2"), ca=late / "ca.pem"),
                "signed by none of its",
            ),
        ):
            with pytest.raises(InfrastructureError, match=said):
                open_client(NetworkLink(RUN, endpoint, "agent-r2", "agent-r2", files), 5.0)
        until(lambda: len(link.denials.counts().get("certificate", {})) == 2)
        assert set(link.denials.counts()["certificate"]) == {"agent-r2", "unknown"}
        notes = " ".join(link.denials.notes())
        assert "refused a connection over TLS: the certificate of 'agent-r2' has expired" in notes
        assert "certificate: UnknownIssuer" in notes
    # Our own programs say so at once.
    with pytest.raises(ScenarioError, match=r"network\.certificates: .*: certificate has expired"):
        joins(late, port)
