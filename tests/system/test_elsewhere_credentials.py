"""Passwords and certificates of roles on other machines, right and wrong."""

import re
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from support.addresses import free_port
from support.certificates import certificates
from support.elsewhere import SCENARIO, Agent, deployment, start, with_password

pytestmark = pytest.mark.system


def test_a_wrong_password_is_refused_within_the_start_deadline(tmp_path, agents) -> None:
    where = with_password(tmp_path)
    run = start(tmp_path, where, "--set", "clock.start_deadline_s=6.0")
    try:
        other = tmp_path / "other"
        other.mkdir()
        (other / "users").write_text("agent-r2:guess\n")
        (other / "users").chmod(0o600)
        (other / "where.toml").write_text(where.read_text())
        agents.append(Agent("r2", other / "where.toml"))
        status, said = agents[0].end()
        assert status == 3
        assert re.search(r"the router at tcp/localhost:\d+: it refused the login: not the", said)
        status, out = run.end()
        assert status == 3
        # Once or twice: asked as a client if the router listened by then, and once more for why.
        times = r"( \(2 times\))?"
        refused = rf"refused the login of 'agent-r2' from [0-9.:\[\]]+: wrong password{times}"
        assert re.search(rf"not (there|ready within 6 s): agent/r2 \({refused}\)", out), out
        assert re.search(r"router: refused the login of 'agent-r2' from .*: wrong password\n", out)
    finally:
        run.kill()
    assert psutil.Process().children() == []


INTRUDER = """
import sys
from bridge.network import keys
from bridge.network.client import open_client
from configs.connections import NetworkLink
with open_client(NetworkLink("", sys.argv[1], "bench", "word"), 10.0) as link:
    for _ in range(5):
        # Not by a publisher: that sends nothing once it is told that nobody listens.
        link._session.put(keys.report(sys.argv[2], "agent/r1"), b"forged")
"""


@pytest.mark.wall_clock
def test_a_denied_put_is_named_in_log_and_summary(tmp_path: Path) -> None:
    (tmp_path / "users").write_text("bench:word\n")
    (tmp_path / "users").chmod(0o600)
    where = tmp_path / "where.toml"
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    guest = f'[network]\nendpoint = "{endpoint}"\nusers = "users"\nguests = {{ bench = ["*"] }}\n'
    where.write_text(guest)
    run = start(tmp_path, where, "--duration", "4")
    try:
        run.await_bus_time(1.3)
        program = [sys.executable, "-c", INTRUDER, endpoint, SCENARIO[0]]
        subprocess.run(program, check=True, timeout=30)
        status, out = run.end()
        assert status == 0, out
    finally:
        run.kill()
    what = f"denied to 'bench' from 127.0.0.1: put on fleetloop/{SCENARIO[0]}/@report/agent/r1"
    assert f"router: {what}\n" in out
    (said,) = run.summary()["notices"]["router"]
    # How often, the client decides too: it may be told that nobody listens there.
    assert re.fullmatch(rf"{re.escape(what)}( \([2-5] times\))?", said)


def with_certificate(folder: Path, machine: str, base: Path | None = None) -> Path:
    tls = (
        f'tls = {{ ca = "ca.pem", certificate = "{machine}.pem", private_key = "{machine}.key" }}\n'
    )
    if base is None:
        return deployment(folder, "tls", tls, machine)
    file = folder / f"{machine}.toml"
    file.write_text(base.read_text().replace("router.", f"{machine}."))
    return file


@pytest.mark.parametrize("key", ["ca", "certificate", "private_key"])
def test_files_of_tls_that_are_missing_are_errors_of_the_deployment(
    key: str, tmp_path: Path, agents: list[Agent]
) -> None:
    certificates(tmp_path, ("agent-r2",))
    where = with_certificate(tmp_path, "agent-r2")
    file = {"ca": "ca.pem", "certificate": "agent-r2.pem", "private_key": "agent-r2.key"}[key]
    (tmp_path / file).unlink()
    run = start(tmp_path, where)
    agents.append(Agent("r2", where))
    try:
        for status, said in (run.end(), agents[0].end()):
            assert status == 2
            assert f"network.tls.{key} = {tmp_path / file}: No such file or directory" in said
    finally:
        run.kill()


@pytest.mark.wall_clock
def test_a_certificate_is_an_identity_and_another_one_is_not(tmp_path, agents) -> None:
    certificates(tmp_path, ("router", "agent-r2", "agent-r1"))
    where = with_certificate(tmp_path, "router")
    impostor = with_certificate(tmp_path, "agent-r1", where)
    run = start(tmp_path, where, "--duration", "2")
    try:
        agents.append(Agent("r2", impostor))
        status, said = agents[0].end()
        assert status == 2
        assert "is the certificate of 'agent-r1' (its common name), not of 'agent-r2'" in said
        genuine = with_certificate(tmp_path, "agent-r2", where)
        agents.append(Agent("r2", genuine, "--set", "duration_s=2.0"))
        status, out = run.end()
        assert status == 0, out
        assert agents[1].end()[0] == 0
    finally:
        run.kill()
