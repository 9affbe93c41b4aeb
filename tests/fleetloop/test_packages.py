"""A project that has packages of our names keeps them, and has our buses and programs as well."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HOST = """
import sys
import can

def test_my_host(fleetloop_plant):
    import configs.errors, bridge.mine
    assert configs.errors.MINE == bridge.mine.MINE == "the project's"
    plant = fleetloop_plant("two_robots", robots=["r1"])
    with can.Bus(**plant.buses["r1"]) as bus:
        assert bus.recv(2.0) is not None
    try:
        can.Bus(interface="fleetloop", channel="r1", endpoint="tcp/127.0.0.1:1", user="me",
            password="secret", connect_timeout=0.5)
    except can.CanInitializationError as error:  # the other way needs more of our modules
        assert "127.0.0.1:1" in str(error)
    import configs, configs.errors, configs.later, bridge
    assert sys.modules["configs"] is configs
    assert configs.later.MINE == configs.errors.MINE == "the project's"
    assert bridge.MINE == "the project's"
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with packages of its own, and a test as the README shows it."""
    for file in (
        "configs/__init__.py",
        "configs/errors.py",
        "configs/later.py",
        "bridge/__init__.py",
        "bridge/mine.py",
        "agents.py",
        "plant/__init__.py",
    ):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text('MINE = "the project\'s"\n')
    (tmp_path / "test_host.py").write_text(HOST)
    return tmp_path


def python(*args: str, cwd: Path, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *args],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=90,
        env=os.environ | {"COLUMNS": "100"} | env,
    )


@pytest.mark.system
def test_the_fixture_and_the_bus_work_beside_packages_of_the_same_names(project: Path) -> None:
    done = python("-m", "pytest", "-q", "-p", "no:cacheprovider", cwd=project)
    assert "1 passed" in done.stdout, done.stdout + done.stderr


def test_a_program_that_has_imported_its_own_packages_keeps_them(project: Path) -> None:
    script = "import bridge, configs.errors\nbefore = bridge, configs, configs.errors\nimport can\n"
    script += "try:\n    can.Bus(interface='fleetloop', channel='nowhere')\n"
    script += "except can.CanInitializationError as error:\n    print(error)\n"
    script += "import bridge, configs.errors\nassert before == (bridge, configs, configs.errors)\n"
    done = python("-c", script, cwd=project)
    assert "no bus 'nowhere' is up" in done.stdout, done.stderr


@pytest.mark.system
@pytest.mark.parametrize("env", [{}, {"PYTHONPATH": "."}])
def test_our_programs_are_ours_wherever_they_are_started(
    env: dict[str, str], project: Path
) -> None:
    verb = ("run", "two_robots", "--duration=0.1", "--allow-unchecked", "--no-report", "--out=run")
    done = python("-m", "fleetloop", *verb, cwd=project, **env)
    assert done.returncode == 0, done.stderr
