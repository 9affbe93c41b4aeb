"""`fleetloop doctor` on this machine."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from support.command_line import fleetloop

TITLES = [
    *("wake-ups", "SCHED_FIFO", "memory locking", "processors", "clock source", "kernel"),
    *("loopback", "folder for sockets", "path of sockets", "open files", "multicast scouting"),
    *("CAN", "versions", "packages", "leftovers", "disk"),
]
PAGE = Path(__file__).parents[3] / "docs" / "doctor.md"


@pytest.fixture
def runtime(tmp_path, monkeypatch):
    """A short path for sockets: those of pytest are long."""
    with TemporaryDirectory(prefix="fl", dir="/tmp") as short:
        monkeypatch.setenv("FLEETLOOP_RUNTIME", short)
        yield tmp_path


def test_there_is_a_line_for_everything_and_a_verdict(runtime: Path) -> None:
    done = fleetloop(runtime, "doctor", "--for", "0.05")
    lines = done.stdout.splitlines()
    told = [line[9:].partition(":")[0] for line in lines[:-1] if not line.startswith(" ")]
    assert [title for title in told if title != "frequency governor"] == TITLES
    assert done.returncode == 0
    assert lines[-1] in ("nothing to change", "runs work here; mind the warnings")


def test_for_programs_it_is_one_document(runtime: Path) -> None:
    done = fleetloop(runtime, "doctor", "--for", "0.05", "--json")
    found = json.loads(done.stdout)
    assert found["sound"] is True
    assert {"level", "title", "value", "limit", "remedy"} == found["findings"][0].keys()


def test_what_is_missing_is_the_exit_status(runtime: Path, monkeypatch) -> None:
    monkeypatch.setenv("FLEETLOOP_RUNTIME", str(runtime / ("d" * 100)))
    done = fleetloop(runtime, "doctor", "--for", "0.05")
    assert done.returncode == 1
    assert "error    folder for sockets: the socket path" in done.stdout
    assert done.stdout.splitlines()[-1] == "something that is needed is missing"


def test_the_page_has_a_row_for_everything() -> None:
    page = PAGE.read_text("utf-8")
    assert [title for title in TITLES if f"| {title} |" not in page] == []
