"""Every Python program in README and docs does what it is there for, as it is printed.

What a page can't know (the endpoint of a run, the folder of a link) is filled in, nothing else.
"""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import can
import pytest
from support.addresses import free_port
from support.processes import completed, running
from support.snippets import Snippet, snippets

from fleetloop.certificates.folder import CertificateFolder

pytestmark = pytest.mark.system
TIMEOUT_S = 60.0
LISTENS = 'with can.Bus(interface="fleetloop", channel="r1") as bus:'
FROM_AFAR = 'endpoint="tls/lab:7447"'
FIXTURE = "(fleetloop_plant):"
SERIAL = 'can.Bus(interface="slcan"'
PYTHON_PAGE, DOOR = "docs/python.md:", "import fleetloop\n"
POSES = "motion_capture()"  # in test_real_robot.py
OWN = "# my_law.py", "# my_shapes.py", "# my_analysed_law.py"  # in tests of own laws
WALKED = "# chase.py", "# my_path.py", "# my_drive.py"  # in tests/docs/test_pages.py
READERS = "# rows.py", "# messages.py"  # in tests/fleetloop/record/test_stock_readers.py


def shown(mark: str) -> list[Snippet]:
    found = [snippet for snippet in snippets("python") if mark in snippet.text]
    assert found, mark
    return found


def test_every_program_that_is_shown_is_tried_here() -> None:
    for snippet in snippets("python"):
        if snippet.where.startswith(PYTHON_PAGE) or snippet.text.startswith(DOOR):
            continue  # in tests/fleetloop/api/test_page.py
        marks = (LISTENS, FROM_AFAR, FIXTURE, SERIAL, POSES, *OWN, *WALKED, *READERS)
        assert sum(mark in snippet.text for mark in marks) == 1, snippet.where


def python(folder: Path, *args: str) -> str:
    """What a Python process prints; it must end well."""
    done = subprocess.run(
        [sys.executable, *args], cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str, str]]:
    """A run that lets the guest of the pages in, for all tests: `run`, and its sockets' folder."""
    folder = tmp_path_factory.mktemp("lab")
    made = CertificateFolder(folder / "certs")
    made.create(["localhost"], days=2, authority_days=2)
    made.issue("bench", days=2, guest=True)
    for name in ("ca.pem", "bench.pem", "bench.key"):
        shutil.copy(made.path / name, folder)
    endpoint = f"tls/localhost:{free_port()}"
    (guests,) = (s for s in snippets("toml") if "[network.guests]" in s.text)
    (folder / "where.toml").write_text(guests.text.replace("tls/lab:7447", endpoint))
    args = ("two_robots", "--speed", "1", "--duration", "600", "--deployment")
    with (
        TemporaryDirectory(prefix="fl-", dir="/tmp") as sockets,
        pytest.MonkeyPatch.context() as environment,
    ):
        environment.setenv("FLEETLOOP_RUNTIME", f"{sockets}/r")
        with running(folder / "run", *args, str(folder / "where.toml"), bus_time_s=0.2):
            yield folder, endpoint, f"{sockets}/r"


@pytest.fixture
def run(lab: tuple[Path, str, str], monkeypatch: pytest.MonkeyPatch) -> tuple[Path, str]:
    """(folder of the run's certificates, its endpoint)."""
    folder, endpoint, sockets = lab
    monkeypatch.setenv("FLEETLOOP_RUNTIME", sockets)
    return folder, endpoint


@pytest.mark.parametrize("snippet", shown(LISTENS), ids=lambda s: s.where)
def test_a_program_that_listens_prints_a_frame(
    snippet: Snippet, run: tuple[Path, str], tmp_path: Path
) -> None:
    assert "ID: " in python(tmp_path, "-c", snippet.text)


@pytest.mark.parametrize("snippet", shown(FROM_AFAR), ids=lambda s: s.where)
def test_a_bus_opens_from_afar(
    snippet: Snippet, run: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, endpoint = run
    monkeypatch.chdir(folder)
    with eval(snippet.text.replace("tls/lab:7447", endpoint), {"can": can}) as bus:
        assert bus.recv(5.0) is not None


@pytest.mark.parametrize("snippet", shown(SERIAL), ids=lambda s: s.where)
def test_a_bus_is_a_serial_adapter(snippet: Snippet, run: tuple[Path, str], tmp_path: Path) -> None:
    link = str(tmp_path / "tty")
    adapter = subprocess.Popen(
        [sys.executable, "-m", "fleetloop", "can", "slcan", "r1", "--link", link],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        assert adapter.stdout is not None
        assert adapter.stdout.readline() == f"{link}\n"
        program = snippet.text.replace("/tmp/ttyCAN", link).replace("...", "print(bus.recv(5.0))")
        assert "ID: " in python(tmp_path, "-c", f"import can\n{program}")
    finally:
        adapter.send_signal(signal.SIGINT)
        adapter.communicate(timeout=TIMEOUT_S)


@pytest.mark.parametrize("snippet", shown(FIXTURE), ids=lambda s: s.where)
def test_an_example_of_the_fixture_passes(snippet: Snippet, tmp_path: Path) -> None:
    (tmp_path / "test_example.py").write_text(snippet.text)
    said = python(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_example.py")
    assert "1 passed" in said


def test_recordings_are_read_as_shown(tmp_path: Path) -> None:
    run = ("two_robots", "--in-process", "--duration", "0.2", "--allow-unchecked")
    assert completed(tmp_path / "run", *run)[0] == 0
    (block,) = (s for s in snippets("sh") if "can.player" in s.text)
    ours = (line for line in block.text.splitlines() if "asammdf" not in line)  # not installed
    lines = [line.partition(" #")[0].split() for line in ours]
    for command in (line for line in lines if line[0] == "python"):
        python(tmp_path / "run" / "can", *command[1:])
    assert "Rx" in (tmp_path / "run" / "can" / "r1.asc").read_text()
