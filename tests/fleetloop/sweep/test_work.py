"""What a worker does: rows, a refusal of another program, one that compiles while others wait."""

import fcntl
import gc
import os
import tempfile
from pathlib import Path

import pytest
from support.studies import FEW, SHORT, P, plan_of

from fleetloop.sweep import work as working
from fleetloop.sweep.versions import mismatch, versions_here
from fleetloop.sweep.work import VersionMismatchError, work

PLAN = plan_of(SHORT + 'design = "grid"\n' + P + FEW)


def test_it_brings_the_rows_and_leaves_the_process_as_it_was() -> None:
    before = gc.get_threshold()
    done = work(PLAN, (2, 0), versions_here(), kernel=False)
    assert done.rows.column("case").to_pylist() == [2, 0]
    assert done.process == os.getpid()
    assert done.busy_s > 0.0
    assert gc.get_threshold() == before


def test_it_refuses_a_program_that_is_another() -> None:
    asked = {**versions_here(), "sources": "0123456789ab"}
    with pytest.raises(VersionMismatchError, match=r"sources \w+, here 0123456789ab"):
        work(PLAN, (0,), asked, kernel=False)


def test_versions_say_what_differs() -> None:
    ours = {"fleetloop": "1.0", "numpy": "2.0"}
    assert mismatch(ours, dict(ours)) == ""
    assert mismatch(ours, {"fleetloop": "1.1"}) == "fleetloop 1.1, here 1.0; numpy absent, here 2.0"


def test_the_first_cases_of_a_process_that_compiles_are_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(working, "_compiled", False)
    path = tmp_path / f"fleetloop-kernel-{os.getuid()}.lock"

    def is_free() -> bool:
        with path.open("r+") as other:
            try:
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return False
            return True

    with working._first_alone(compiles=True):
        assert not is_free()
    with working._first_alone(compiles=True):
        assert is_free()
