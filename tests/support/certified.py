"""A run's router whose deployment names a folder of certificates, and machines with files of it."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import Any

from support.addresses import free_port

from bridge.network.client import open_client
from bridge.network.router import RouterLink, open_router
from bridge.network.zenoh_link import ZenohLink
from bridge.process.clock import SYSTEM_CLOCK
from configs.connections import NetworkLink
from configs.deployment import Deployment, check_deployment
from configs.errors import InfrastructureError
from configs.loading import load
from configs.tls import TlsFiles
from fleetloop.certificates.folder import CertificateFolder
from fleetloop.launch import placement

SCENARIO = load("two_robots_100hz")
RUN = SCENARIO.name


def authority(path: Path) -> CertificateFolder:
    """On the machine with the router; both robots are elsewhere, and a bench may have a bus."""
    made = CertificateFolder(path)
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


def machine(base: CertificateFolder, identity: str, name: str = "") -> Path:
    """A robot's: a folder with its files of now, perhaps under the name of another."""
    folder = base.path.parent / f"{identity} as {name}"
    folder.mkdir()
    shutil.copy(base.path / "ca.pem", folder)
    for suffix in (".pem", ".key"):
        shutil.copy(base.path / f"{identity}{suffix}", folder / f"{name or identity}{suffix}")
    return folder


@contextmanager
def routing(base: CertificateFolder) -> Iterator[tuple[RouterLink, int]]:
    port = free_port()
    where = deployment(base.path, port)
    placement.check_credentials(SCENARIO, where)
    plan = placement.access_plan(SCENARIO, where, RUN)
    with open_router(None, plan, base.path.parent, placement.outside(where)) as link:
        yield link, port


def joins(certificates: Path, port: int, identity: str = "agent-r2") -> ZenohLink:
    """As our own programs do."""
    role = identity.replace("-", "/", 1)
    network = placement.network_link(SCENARIO, deployment(certificates, port), role)
    return open_client(network, 5.0)


def claims(port: int, user: str, password: str, files: TlsFiles) -> ZenohLink:
    """As any program can."""
    return open_client(NetworkLink(RUN, f"tls/localhost:{port}", user, password, files), 5.0)


def refusal(opens: Callable[[], ZenohLink]) -> str:
    """Why there is no session."""
    try:
        opens().close()
    except InfrastructureError as error:
        return str(error)
    raise AssertionError("not refused")


def until(holds: Callable[[], object], act: Callable[[], object] = lambda: None) -> None:
    deadline = SYSTEM_CLOCK.monotonic_s() + 10.0
    while not holds():
        assert SYSTEM_CLOCK.monotonic_s() < deadline
        act()
        Event().wait(0.01)


def told(program: str, folder: Path) -> Any:
    """What a program with these names prints as JSON: Zenoh's log is a process's own, once."""
    done = subprocess.run(
        [sys.executable, "-c", f"{PROLOGUE}{program}", str(folder)],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


PROLOGUE = """
import json, sys
from dataclasses import replace
from pathlib import Path
from support.certified import *
from support.clocks import ManualClock
from bridge.network import keys
from configs.tls import files_in
folder = Path(sys.argv[1])
base = authority(folder / "base")
"""
