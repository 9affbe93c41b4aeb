"""The systemd unit starts what exists, and is one that systemd takes."""

import shlex
import shutil
import subprocess
from configparser import ConfigParser
from pathlib import Path

import pytest
from typer.main import get_command

from fleetloop.cli import app

UNIT = Path(__file__).parent.parent / "packaging/systemd/fleetloop-agent@.service"


def service() -> dict[str, str]:
    parser = ConfigParser(interpolation=None, strict=False)
    parser.optionxform = str
    parser.read(UNIT)
    return dict(parser["Service"])


def test_its_command_is_one_that_the_command_line_has() -> None:
    program, verb, *arguments = shlex.split(service()["ExecStart"])
    assert program.endswith("/fleetloop")
    command = get_command(app).commands[verb]
    options = {option for parameter in command.params for option in parameter.opts}
    assert {argument for argument in arguments if argument.startswith("--")} <= options
    assert "%i" in arguments


def test_it_may_do_what_real_time_and_can_need() -> None:
    unit = service()
    assert int(unit["LimitRTPRIO"]) >= 45
    assert {"AF_CAN", "AF_UNIX", "AF_INET"} <= set(unit["RestrictAddressFamilies"].split())


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze")
def test_systemd_finds_nothing_wrong_but_the_program_that_is_not_installed(tmp_path) -> None:
    instance = tmp_path / "fleetloop-agent@r1.service"
    instance.write_text(UNIT.read_text())
    done = subprocess.run(
        ["systemd-analyze", "verify", str(instance)], capture_output=True, text=True, timeout=60
    )
    said = [line for line in done.stderr.splitlines() if "fleetloop-agent" in line]
    assert all("is not executable" in line for line in said), said
