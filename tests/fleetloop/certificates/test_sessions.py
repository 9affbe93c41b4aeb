"""Certificates at a router: a deployment's folder says whom it lets in, over real sessions."""

from pathlib import Path

import pytest
from support.certified import (
    RUN,
    SCENARIO,
    authority,
    deployment,
    joins,
    machine,
    routing,
    told,
    until,
)
from support.clocks import ManualClock

from bridge.network import keys
from bridge.process.clock import SYSTEM_CLOCK
from configs.errors import ScenarioError
from fleetloop.certificates.folder import CertificateFolder
from fleetloop.launch import placement

pytestmark = pytest.mark.system
DAY_NS = 86_400 * 10**9
SUCCEEDED = """
old = machine(base, "agent-r2")
base.revoke("agent-r2")
base.issue("agent-r2", days=30)
with routing(base) as (link, port):
    said = refusal(lambda: joins(old, port))
    until(link.denials.counts)
    with joins(base.path, port):
        pass
    link.subscribe(keys.path(RUN, "r2"), "path")
    with claims(port, "agent-r2", "agent-r2#2", files_in(old, "agent-r2")) as liar:
        mouth = liar.publisher(keys.path(RUN, "r2"))
        until(lambda: "certificate" in link.denials.counts(), lambda: mouth.put(b"by a revoked"))
    heard = link.receive(0.2)
print(json.dumps([said, link.denials.counts(), link.denials.notes(), heard]))
"""
IMPOSTOR = """
files = files_in(machine(base, "agent-r1"), "agent-r1")
with routing(base) as (link, port):
    link.subscribe(keys.path(RUN, "r2"), "path")
    with claims(port, "agent-r2", "agent-r2", files) as impostor:
        mouth = impostor.publisher(keys.path(RUN, "r2"))
        until(link.denials.counts, lambda: mouth.put(b"by r1"))
    heard = link.receive(0.2)
print(json.dumps([link.denials.counts(), link.denials.notes(), heard]))
"""
OUTSIDERS = """
from bridge.process.clock import SYSTEM_CLOCK
then = ManualClock(SYSTEM_CLOCK.wall_ns() - 40 * 86_400 * 10**9)
CertificateFolder(base.path, clock=then).renew("agent-r2", days=39)
late = machine(base, "agent-r2")
base.renew("agent-r2", days=30)
foreign = files_in(authority(folder / "other").path, "agent-r2")
with routing(base) as (link, port):
    said = [
        refusal(lambda: claims(port, "agent-r2", "agent-r2", files))
        for files in (files_in(late, "agent-r2"), replace(foreign, ca=late / "ca.pem"))
    ]
    until(lambda: len(link.denials.counts().get("certificate", {})) == 2)
print(json.dumps([said, link.denials.counts(), link.denials.notes()]))
"""


@pytest.fixture
def base(tmp_path: Path) -> CertificateFolder:
    return authority(tmp_path / "base")


def test_a_robot_with_its_certificate_is_heard_also_after_that_was_renewed(base) -> None:
    robot = machine(base, "agent-r2")
    base.renew("agent-r2", days=60)  # the one on the robot stays good
    with routing(base) as (link, port), joins(robot, port) as r2:
        link.subscribe(keys.path(RUN, "r2"), "path")
        mouth = r2.publisher(keys.path(RUN, "r2"))
        until(lambda: link.receive(0.0), lambda: mouth.put(b"here"))


def test_a_revoked_certificate_is_refused_and_has_no_right_even_if_it_lies(tmp_path) -> None:
    said, counts, notes, heard = told(SUCCEEDED, tmp_path)
    assert "it refused the login: not the password or present certificate of 'agent-r2'" in said
    assert set(counts["login"]) == set(counts["certificate"]) == {"agent-r2"}
    assert (
        "refused the login of 'agent-r2' from 127.0.0.1: its certificate is revoked: it is that"
        " of 'agent-r2'" in notes[0]
    )
    assert heard is None


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


def test_a_robot_that_speaks_under_another_name_is_refused_with_both_names(tmp_path) -> None:
    counts, notes, heard = told(IMPOSTOR, tmp_path)
    assert heard is None
    assert set(counts["certificate"]) == {"agent-r1"}
    assert any(
        "'agent-r2' from 127.0.0.1 came with the certificate of 'agent-r1'" in note
        for note in notes
    )


def test_an_expired_certificate_and_one_of_another_authority_are_refused(tmp_path) -> None:
    said, counts, notes = told(OUTSIDERS, tmp_path)
    assert "CertificateExpired" in said[0]
    assert "signed by none of its authority" in said[1]
    assert set(counts["certificate"]) == {"agent-r2", "unknown"}
    assert "refused a connection over TLS: the certificate of 'agent-r2' has expired" in notes[0]
    assert "invalid peer certificate: UnknownIssuer" in notes[1]


def test_our_own_programs_refuse_such_files_before_they_connect(base) -> None:
    with pytest.raises(
        ScenarioError, match=r"of 'agent-r1' \(its common name\), not of 'agent-r2'"
    ):
        joins(machine(base, "agent-r1", "agent-r2"), 7447)
    then = ManualClock(SYSTEM_CLOCK.wall_ns() - 40 * DAY_NS)
    CertificateFolder(base.path, clock=then).renew("agent-r2", days=39)
    with pytest.raises(ScenarioError, match=r"network\.certificates: .*: certificate has expired"):
        joins(base.path, 7447)
