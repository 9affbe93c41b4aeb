"""Runs whose files are not all there, or not what they should be: one line each, no wrong row."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from support.command_line import fleetloop

from configs.errors import FleetloopError
from fleetloop.record.reader import Record
from fleetloop.record.scan import RecordError
from fleetloop.results.diff import print_comparison
from fleetloop.results.export import export
from fleetloop.results.report import write_report
from fleetloop.results.run_folder import IncompleteError, read_record


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as arrays:
        return dict(arrays)


@pytest.fixture
def cut_run(finished_run: Path, tmp_path: Path) -> Path:
    """Its record ends in the middle."""
    folder = tmp_path / "cut"
    folder.mkdir()
    content = (finished_run / "record.mcap").read_bytes()
    (folder / "record.mcap").write_bytes(content[: len(content) // 2])
    return folder


@pytest.fixture
def damaged_run(finished_run: Path, tmp_path: Path) -> Path:
    """A byte in the middle of its record is another one."""
    folder = tmp_path / "damaged"
    folder.mkdir()
    content = bytearray((finished_run / "record.mcap").read_bytes())
    content[len(content) // 2] ^= 0x40
    (folder / "record.mcap").write_bytes(content)
    return folder


def test_a_cut_record_is_exported_only_if_asked_for(
    cut_run: Path, finished_run: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    told = r"record\.mcap: cut at byte \d+; in it are r1(, r2)?: 1024 ticks up to 2.046 s"
    with pytest.raises(IncompleteError, match=told) as refused:
        export(cut_run, tmp_path / "a.npz")
    assert refused.value.exit_status == 1
    assert "--partial" in str(refused.value)
    assert not (tmp_path / "a.npz").exists()
    export(cut_run, tmp_path / "a.npz", partial=True)
    assert "cut at byte" in capfd.readouterr().err
    export(finished_run, tmp_path / "whole.npz")
    part, whole = arrays_of(tmp_path / "a.npz"), arrays_of(tmp_path / "whole.npz")
    rows = len(part["t_s"])
    assert 0 < rows < len(whole["t_s"])
    assert np.array_equal(part["x_m"], whole["x_m"][:rows])


def test_a_damaged_record_is_exported_up_to_its_damage_if_asked_for(
    damaged_run: Path, tmp_path: Path
) -> None:
    with pytest.raises(RecordError, match=r"damaged at byte \d+: .*; --partial reads") as refused:
        export(damaged_run, tmp_path / "a.csv")
    assert refused.value.exit_status == 2
    assert 0 < export(damaged_run, tmp_path / "a.csv", partial=True) < 4000


def test_two_cut_records_are_not_said_to_be_the_same(
    cut_run: Path, finished_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(IncompleteError):
        print_comparison(cut_run, cut_run, as_json=False)
    capsys.readouterr()
    assert print_comparison(cut_run, finished_run, as_json=False, partial=True) == 0
    out = capsys.readouterr().out
    assert "every signal that both have" in out
    assert print_comparison(cut_run, finished_run, as_json=True, partial=True) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["lost"][0].startswith("cut at byte")
    assert said["lost"][1] == ""


def test_the_page_of_a_cut_record_says_so(cut_run: Path) -> None:
    page = write_report(cut_run, read_record(cut_run, partial=True)).read_text("utf-8")
    assert "The record isn't all there: cut at byte" in page.replace("&#x27;", "'")


@pytest.mark.parametrize("verb", ["report", "export", "diff"])
def test_the_command_line_says_so_in_one_line(verb: str, cut_run: Path, tmp_path: Path) -> None:
    more = {"report": [], "export": [str(tmp_path / "a.csv")], "diff": [str(cut_run)]}[verb]
    done = fleetloop(tmp_path, verb, str(cut_run), *more)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "ticks up to" in done.stderr


def folders(finished_run: Path, at: Path) -> dict[str, Path]:
    """Things that aren't a run's folder."""
    for name in ("empty", "record_is_a_folder", "record_is_empty"):
        (at / name).mkdir()
    (at / "record_is_a_folder" / "record.mcap").mkdir()
    (at / "record_is_empty" / "record.mcap").touch()
    (at / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(1000))
    os.mkfifo(at / "pipe")
    names = ("empty", "record_is_a_folder", "record_is_empty", "picture.png", "pipe", "nowhere")
    others = {"too long": at / ("x" * 5000), "in a file": finished_run / "scenario.toml" / "x"}
    return {name: at / name for name in names} | others


def test_what_is_no_run_is_refused_in_one_line(finished_run: Path, tmp_path: Path) -> None:
    for name, path in folders(finished_run, tmp_path).items():
        for read in (
            write_report,
            lambda path: export(path, tmp_path / "a.csv"),
            lambda path: print_comparison(path, finished_run, as_json=False),
            lambda path: print_comparison(finished_run, path, as_json=False),
        ):
            with pytest.raises(FleetloopError) as refused:
                read(path)
            assert refused.value.exit_status == 2, name
            assert "\n" not in str(refused.value)
            assert str(path)[:200] in str(refused.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_record_that_may_not_be_read_is_refused(cut_run: Path) -> None:
    (cut_run / "record.mcap").chmod(0)
    with pytest.raises(RecordError, match="can't be read: Permission denied"):
        Record.open(cut_run / "record.mcap")
