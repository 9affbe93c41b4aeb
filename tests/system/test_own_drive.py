"""A drive protocol in a package beside the scenario file, which nothing else has on its path."""

import subprocess
import sys
from pathlib import Path
from shutil import copytree

import pytest
from support import second_drive
from support.processes import completed
from support.snippets import snippets
from support.walkthrough import write

pytestmark = pytest.mark.system
QUICK = ("--duration", "1", "--allow-unchecked", "--clock", "lockstep")
SCENARIO = """
schema = 1
name = "own_drive"
clock = { mode = "lockstep" }
drive = { protocol = "my_drive:ROW", torque_unit_shaft_N_m = 0.01 }
robot = [{ name = "r1", pose = { x_m = -3.5, y_m = 0.0, theta_rad = 0.0 } }]
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """The folder of a scenario and its protocol."""
    folder = tmp_path / "own"
    copytree(Path(second_drive.__file__).parent, folder / "my_drive")
    for file in (folder / "my_drive").glob("*.py"):
        file.write_text(file.read_text().replace("support.second_drive", "my_drive"))
    (folder / "own.toml").write_text(SCENARIO)
    return folder


def fleetloop(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-P", "-m", "fleetloop", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=100,
    )


def test_processes_import_it_from_there_and_leave_the_same_record(own: Path) -> None:
    scenario = str(own / "own.toml")
    assert completed(own / "a", scenario, "--in-process", *QUICK)[0] == 0
    assert completed(own / "b", scenario, *QUICK)[0] == 0
    done = fleetloop(own.parent, "diff", "own/a", "own/b")
    assert (done.returncode, done.stdout.partition(":")[0]) == (0, "identical"), done.stdout
    (own / "my_drive" / "__init__.py").unlink()
    done = fleetloop(own.parent, "report", "own/a")
    assert done.returncode == 0, done.stderr


def test_the_protocol_of_the_page_leaves_the_same_record_over_processes(tmp_path: Path) -> None:
    shown = [one for one in snippets("toml", "python") if one.where.startswith("docs/drive-pro")]
    for block in shown:
        write(tmp_path, block)
    scenario = str(tmp_path / "drives.toml")
    assert completed(tmp_path / "a", scenario, "--in-process", *QUICK)[0] == 0
    assert completed(tmp_path / "b", scenario, *QUICK)[0] == 0
    done = fleetloop(tmp_path, "diff", "a", "b")
    assert (done.returncode, done.stdout.partition(":")[0]) == (0, "identical"), done.stdout


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\ndef broken(:\n", "my_drive/__init__.py, line 2: invalid syntax"),
        ("ROW = 1 / 0\n", "my_drive/__init__.py, line 1: ZeroDivisionError"),
        ("X = 1\n", "my_drive/__init__.py has no ROW"),
    ],
)
def test_what_is_wrong_is_said_before_the_run(own: Path, text: str, said: str) -> None:
    (own / "my_drive" / "__init__.py").write_text(text)
    done = fleetloop(own.parent, "check", "own/own.toml")
    assert done.returncode == 2, done.stdout + done.stderr
    assert 'drive.protocol = "my_drive:ROW"' in done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
