"""Three hosts as network namespaces: a slow, lossy link, a cut, a router's restart, intruders."""

import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.clocks import ManualClock
from support.hosts import Host, allowed, hosts
from support.processes import Run
from support.stock_router import StockRouter

from bridge.process.clock import SYSTEM_CLOCK
from configs.roles import identity_of, processes_of
from fleetloop.certificates.folder import CertificateFolder
from fleetloop.record.reader import Record

pytestmark = [
    pytest.mark.system,
    pytest.mark.wall_clock,
    pytest.mark.skipif(not allowed(), reason="no right to make network namespaces"),
]
KEYS = ("expect=[]", "host.rearm=true", "duration_s=22.0")
SCENARIO = ("two_robots_100hz", *(word for key in KEYS for word in ("--set", key)))
PORT = 7447
CUT_S, REJOINED_S = 5.0, 2.0
LOSSY_REJOINED_S = 4.0
"""With two of the words lost that TCP says again after a second only."""


@pytest.fixture
def three() -> Iterator[list[Host]]:
    with hosts("base", "hub", "rob") as made:
        yield made


def fleet(folder: Path, router: Host, keys: str) -> Path:
    """A deployment with r2's controller elsewhere, and the certificates of all."""
    made = CertificateFolder(folder / "certs")
    made.create([router.address], days=2, authority_days=2)
    for identity in (*map(identity_of, processes_of(("r1", "r2"))), "launcher"):
        made.issue(identity, days=2)
    made.issue("bench", days=2, guest=True)
    where = folder / "fleet.toml"
    where.write_text(
        'roles = ["plant", "recorder", "agent/r1"]\n[network]\n'
        f'endpoint = "tls/{router.address}:{PORT}"\ncertificates = "certs"\n{keys}\n'
    )
    return where


def outdated(certs: Path, folder: Path) -> Path:
    """A machine of r2 with a certificate that has expired, of the same authority."""
    then = ManualClock(SYSTEM_CLOCK.wall_ns() - 40 * 86_400 * 10**9)
    CertificateFolder(certs, clock=then).renew("agent-r2", days=39)
    shutil.copytree(certs, folder)
    CertificateFolder(certs).renew("agent-r2", days=2)
    return folder


def launch(host: Host, folder: Path, where: Path, *args: str) -> Run:
    class HostRun(Run):
        before = host.exec

    return HostRun(folder / "run", *SCENARIO, "--deployment", str(where), *args)


def agent(host: Host, where: Path) -> "subprocess.Popen[str]":
    command = ("-m", "fleetloop", "agent", SCENARIO[0], "r2", *SCENARIO[1:])
    return subprocess.Popen(
        [*host.exec, sys.executable, *command, "--deployment", str(where)],
        stderr=subprocess.PIPE,
        text=True,
    )


def there_again_within(
    run: Run, since_s: float, already: int = 0, bound_s: float = REJOINED_S
) -> None:
    """r2 is back, so soon after the network was."""
    back = "r2: .*: there again after .*"
    pattern = f"(?:{back}\n(?:.*\n)*?)" * already + back
    run.await_line(pattern, 20.0)
    assert time.monotonic() - since_s < bound_s


def test_a_robot_that_is_cut_off_and_a_router_that_is_restarted_are_back_within_two_seconds(
    three: list[Host], tmp_path: Path
) -> None:
    base, hub, rob = three
    rob.delay_s, rob.loss = 0.02, 0.05
    where = fleet(tmp_path, hub, 'router = "external"\nrejoin_s = 10.0')
    config = tmp_path / "router.json5"
    command = ("network", "--router-config", SCENARIO[0], str(where), "--out", str(config))
    subprocess.run([sys.executable, "-m", "fleetloop", *command], check=True, timeout=60)
    router = StockRouter(config, *hub.exec)
    run = launch(base, tmp_path, where)
    run.await_bus().shutdown()  # r2's is the robot's own cable, and comes with it
    far = agent(rob, where)
    try:
        run.await_bus_time(3.0)
        rob.loss = 0.0
        rob.cut = True
        run.wait(CUT_S)
        rob.cut = False
        since_s = time.monotonic()
        run.await_line(
            r"r2: tick \d+ \(t = \S+ s\): cut_off: its machine, or the network to it", 1.0
        )
        there_again_within(run, since_s)
        for already, loss, bound_s in ((1, 0.0, REJOINED_S), (2, 0.05, LOSSY_REJOINED_S)):
            rob.loss = loss
            router.kill()
            run.wait(1.0)
            router = StockRouter(config, *hub.exec)
            there_again_within(run, time.monotonic(), already, bound_s)
        status, out = run.end()
        assert status == 0, out
        _, said = far.communicate(timeout=20.0)
        assert far.returncode == 0, said
    finally:
        run.kill()
        far.kill()
        far.communicate()
        router.kill()
    told = "\n".join(run.summary()["notices"]["r2"])
    assert re.search("stopped: (no pose from|cut off from the launcher)", told)
    assert ": rearmed" in told
    clock = run.summary()["clock_offsets"]["agent/r2"]
    assert 15.0 < clock["uncertain_ms"] < 60.0  # 20 ms each way
    record = Record.open(tmp_path / "run" / "record.mcap")
    assert all(len(rows) == 2200 for rows in record.controller.values())
    assert all(robot["peak_torque_wheel_N_m"] > 0.0 for robot in run.summary()["robots"].values())


INTRUDERS = """
import sys
from pathlib import Path
from configs.connections import NetworkLink
from configs.errors import InfrastructureError
from configs.tls import files_in
from bridge.network.client import open_client
from bridge.network import keys
endpoint, run, certs, late, other = sys.argv[1], sys.argv[2], *map(Path, sys.argv[3:])

def claims(user, name, files):
    return open_client(NetworkLink(run, endpoint, user, name, files), 5.0)

for files in (files_in(late, "agent-r2"), files_in(other, "agent-r2"), files_in(certs, "bench")):
    try:
        with claims("agent-r1", "agent-r1#9", files):  # not the name of the present certificate
            raise SystemExit("let in")
    except InfrastructureError:
        pass
with claims("bench", "bench", files_in(certs, "agent-r2")) as impostor:
    impostor.publisher(keys.path(run, "r1")).put(b"forged")
with claims("bench", "bench", files_in(certs, "bench")) as flooder:
    for _ in range(3000):
        flooder._session.put("anything/at/all", b"flood")  # rates of our own keys are limited
    print("said", flush=True)
    sys.stdin.read()
"""


def test_every_refused_attempt_from_another_host_is_counted_by_its_identity(
    three: list[Host], tmp_path: Path
) -> None:
    base, rob, elsewhere = three
    rob.delay_s = elsewhere.delay_s = 0.02
    where = fleet(tmp_path, base, 'guests = { bench = ["r1"] }')
    certs = tmp_path / "certs"
    late = outdated(certs, tmp_path / "late")
    other = CertificateFolder(tmp_path / "other")
    other.create([base.address], days=2, authority_days=2)
    other.issue("agent-r2", days=2)
    (other.path / "ca.pem").write_bytes((certs / "ca.pem").read_bytes())  # trusts the router
    run = launch(base, tmp_path, where, "--duration", "10")
    run.await_bus().shutdown()
    far = agent(rob, where)
    names = (f"tls/{base.address}:{PORT}", SCENARIO[0], certs, late, other.path)
    intruders = None
    try:
        run.await_bus_time(1.5)
        intruders = subprocess.Popen(
            [*elsewhere.exec, sys.executable, "-c", INTRUDERS, *map(str, names)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert intruders.stdout.readline() == "said\n"
        run.await_line("router: cut off 'bench' from .*", 10.0)
        status, out = run.end()
        assert status == 0, out
    finally:
        run.kill()
        for process in (far, intruders):
            if process is not None:
                process.kill()
                process.communicate()
    refused = run.summary()["refused"]
    assert set(refused["certificate"]) == {"agent-r2", "unknown"}  # expired or as bench; foreign
    assert set(refused["login"]) == {"agent-r1"}
    assert refused["rights"]["bench"] >= 1000
    assert set(refused["flood"]) == {"bench"}
    for line in (
        "router: refused a connection over TLS: the certificate of 'agent-r2' has expired",
        f"router: refused the login of 'agent-r1' from {elsewhere.address}: wrong password",
        f"router: 'bench' from {elsewhere.address} came with the certificate of 'agent-r2'",
    ):
        assert line in out
