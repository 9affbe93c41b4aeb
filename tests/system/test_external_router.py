"""A router of its own, with the configuration that `fleetloop network` writes, serves a run."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import zenoh
from support.addresses import free_port
from support.processes import completed
from support.stock_router import stock_router

from configs.roles import identity_of, processes_of
from fleetloop.certificates.folder import CertificateFolder
from fleetloop.record.reader import Record

pytestmark = [pytest.mark.system, pytest.mark.wall_clock]
SCENARIO = "two_robots_100hz"
IDENTITIES = [*map(identity_of, processes_of(("r1", "r2"))), "launcher"]


def deployment(folder: Path, scheme: str, credentials: str) -> Path:
    file = folder / "fleet.toml"
    file.write_text(
        f'[network]\nrouter = "external"\nendpoint = "{scheme}/localhost:{free_port()}"\n'
        f"{credentials}\n"
    )
    return file


def with_certificates(folder: Path) -> Path:
    made = CertificateFolder(folder / "certs")
    made.create(["localhost"], days=2, authority_days=2)
    for identity in IDENTITIES:
        made.issue(identity, days=2)
    return deployment(folder, "tls", 'certificates = "certs"')


def with_passwords(folder: Path, identities: list[str] = IDENTITIES) -> Path:
    users = folder / "users"
    users.write_text("".join(f"{identity}:word of {identity}\n" for identity in identities))
    users.chmod(0o600)
    return deployment(folder, "tcp", 'users = "users"')


def written(where: Path) -> Path:
    out = where.with_name("router.json5")
    command = ("network", "--router-config", SCENARIO, str(where), "--out", str(out))
    subprocess.run([sys.executable, "-m", "fleetloop", *command], check=True, timeout=60)
    return out


def test_a_run_at_a_stock_router_is_complete(tmp_path: Path) -> None:
    where = with_certificates(tmp_path)
    with stock_router(written(where)):
        args = ("--deployment", str(where), "--set", "expect=[]", "--duration", "2")
        status, out = completed(tmp_path / "run", SCENARIO, *args)
    assert status == 0, out
    record = Record.open(tmp_path / "run" / "record.mcap")
    for rows in (*record.plant.values(), *record.controller.values()):
        assert rows["tick"].tolist() == list(range(200))


def test_a_page_is_refused_before_anything_is_started(tmp_path: Path) -> None:
    where = with_passwords(tmp_path)
    args = (SCENARIO, "--deployment", str(where), "--live")
    status, out = completed(tmp_path / "run", *args)
    assert status == 2
    assert f"--live with --deployment {where}: a router of its own knows no viewer" in out
    assert not (tmp_path / "run").exists()


def test_the_file_has_limits_and_rights_and_its_users_are_for_their_owner(tmp_path: Path) -> None:
    out = written(with_passwords(tmp_path))
    config = zenoh.Config.from_file(str(out))
    rules = json.loads(config.get_json("access_control"))
    assert rules["default_permission"] == "deny"
    assert {subject["id"] for subject in rules["subjects"]} == set(IDENTITIES)
    assert json.loads(config.get_json("low_pass_filter"))
    assert json.loads(config.get_json("downsampling"))
    users = Path(json.loads(config.get_json("transport/auth/usrpwd/dictionary_file")))
    assert users.stat().st_mode & 0o777 == 0o600
    assert "launcher:word of launcher\n" in users.read_text()


def test_without_the_router_or_an_identity_the_run_says_what_is_missing(tmp_path: Path) -> None:
    args = ("--set", "expect=[]", "--set", "clock.start_deadline_s=2.0")
    where = with_passwords(tmp_path)
    status, out = completed(tmp_path / "run", SCENARIO, "--deployment", str(where), *args)
    assert status == 3
    assert "launcher: no session with the router at tcp/localhost" in out
    where = with_passwords(tmp_path, IDENTITIES[1:])
    status, out = completed(tmp_path / "run", SCENARIO, "--deployment", str(where), *args)
    assert status == 2
    assert f"no line {IDENTITIES[0]}:<password>" in out
