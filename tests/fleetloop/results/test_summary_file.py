"""`summary.json` as it may be found: a run's is read, everything else is refused by name."""

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from configs.errors import ScenarioError
from configs.loading import load
from fleetloop.record.reader import Record
from fleetloop.results.interactive import windows_of
from fleetloop.results.known import Known
from fleetloop.results.panel import Panel
from fleetloop.results.report import words_of_run, write_report
from fleetloop.results.summary import RunStats, summarise, to_json
from fleetloop.results.summary_file import read_summary
from fleetloop.results.view import View

GONE = object()
"""Instead of a value: it isn't there at all."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"[]", "not an object"),
        (b"null", "not an object"),
        (b'"held"', "not an object"),
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (b"\xff\xfe{}", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b"{}", "verdict is missing"),
    ],
)
def test_what_is_no_summary_is_refused_in_one_line(
    finished_run: Path, folder: Path, content: bytes, message: str
) -> None:
    (folder / "summary.json").write_bytes(content)
    (folder / "record.mcap").write_bytes((finished_run / "record.mcap").read_bytes())
    with pytest.raises(ScenarioError, match=message) as refused:
        write_report(folder)
    assert str(refused.value).startswith(f"{folder / 'summary.json'}: ")
    assert "\n" not in str(refused.value)
    assert not (folder / "report.html").exists()


def test_a_summary_that_is_a_folder_is_refused(folder: Path) -> None:
    (folder / "summary.json").mkdir()
    with pytest.raises(ScenarioError, match="can't be read: Is a directory"):
        read_summary(folder)


def test_no_summary_is_no_error(folder: Path) -> None:
    assert read_summary(folder) is None


def paths(value: Any, at: tuple = ()) -> Iterator[tuple]:
    """Where everything in it is."""
    if at:
        yield at
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from paths(item, (*at, key))


def changed(summary: dict[str, Any], at: tuple, other: Any) -> dict[str, Any]:
    """The same but for one place."""
    made = copy.deepcopy(summary)
    holder = made
    for key in at[:-1]:
        holder = holder[key]
    if other is GONE:
        del holder[at[-1]]
    else:
        holder[at[-1]] = other
    return made


def test_whatever_is_read_can_be_shown(finished_run: Path, folder: Path) -> None:
    summary = json.loads((finished_run / "summary.json").read_bytes())
    summary["realtime"] = {
        "miss_percent": 0.1,
        "late_us": {"p50": 1.0},
        "round_trip_us": {},
        "cpu_percent_of_one_core": 90.0,
        "missing_privileges": ["SCHED_FIFO"],
    }
    summary["machine"] = {
        "stalls": 1,
        "stalled_s": 0.7,
        "longest_stall_s": 0.7,
        "longest_stall_at_s": 1.0,
        "stopped_and_continued": 1,
        "plant_stalls": [{"t_s": 1.0, "lasted_s": 0.7}],
    }
    record, scenario = Record.open(finished_run / "record.mcap"), load("two_robots")
    refused = 0
    for at in paths(summary):
        for other in (GONE, None, [], {}, "x", 1.5, False):
            (folder / "summary.json").write_text(json.dumps(changed(summary, at, other)))
            try:
                found = read_summary(folder)
            except ScenarioError as error:
                assert str(at[0]) in str(error) or "robots" in str(error)
                refused += 1
                continue
            known = Known(record, scenario, found)
            words_of_run(known)
            view = View(*known)
            windows_of(view)
            for signal in ("x_e_m", "s_spread"):
                view.expect(Panel("", "m"), signal)
    assert refused > 300


def test_what_a_run_leaves_is_read(finished_run: Path) -> None:
    assert read_summary(finished_run) == json.loads((finished_run / "summary.json").read_bytes())


def test_a_run_that_diverged_to_no_number_is_shown(finished_run: Path, tmp_path: Path) -> None:
    record, scenario = Record.open(finished_run / "record.mcap"), load("two_robots")
    for rows in record.controller.values():
        for name in set(rows.dtype.names[2:]) - {"s"}:  # beyond its reach it isn't taken
            rows[name][1500:] = np.nan
    summary = summarise(record, scenario, RunStats("lockstep"))
    (tmp_path / "summary.json").write_text(to_json(summary))
    for shown in (summary, read_summary(tmp_path)):
        assert "no number" in "".join(words_of_run(Known(record, scenario, shown)))
