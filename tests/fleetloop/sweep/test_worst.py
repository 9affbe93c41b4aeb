"""The worst cases: which they are, and that their whole runs are the same runs."""

from dataclasses import replace

import pytest
from support.studies import SHORT, P, cases_of, plan_of, study_folder

from bridge.process.lifecycle import Stop
from fleetloop.record.reader import Record
from fleetloop.results.run_folder import RECORD, SUMMARY
from fleetloop.results.summary_file import read_summary
from fleetloop.sweep.batch import rows_of
from fleetloop.sweep.dataset import Columns, Dataset, read
from fleetloop.sweep.watch import Watch
from fleetloop.sweep.worst import WholeRun, keep_worst, missing_of, worst_of

TEXT = SHORT + 'design = "grid"\n' + P


def test_those_that_failed_come_first_then_the_least_margins(tmp_path) -> None:
    cases = cases_of(TEXT.replace("[0.5, 1.0, 2.0]", "[0.5, 1.0, 2.0, 3.0, 4.0, 5.0]"))
    rows = rows_of(cases, range(6), Watch(300.0))
    told = [
        ("held", 0.3), ("failed", -0.2), ("error", None), ("held", 0.1), ("failed", float("-inf")),
        ("not checked", None),
    ]  # fmt: skip
    columns = Columns(cases)
    dataset = Dataset(tmp_path, 6, columns.schema)
    changed = [
        replace(row, verdict=verdict, margin=margin)
        for row, (verdict, margin) in zip(rows, told, strict=True)
    ]
    dataset.add(columns.batch(changed))
    dataset.close()
    assert worst_of(tmp_path, 10) == [4, 1, 3, 0, 5]
    assert worst_of(tmp_path, 2) == [4, 1]


def test_a_whole_run_is_that_of_the_row(tmp_path) -> None:
    folder = study_folder(tmp_path, TEXT)
    job = WholeRun(plan_of(TEXT), 1, folder / "worst" / "case-000001")
    job.work(lambda _: None, Stop())
    row = read(folder).to_pylist()[1]
    summary = read_summary(job.folder)
    assert summary is not None
    assert summary["verdict"] == row["verdict"]
    assert summary["worst"]["final_max"]["x_e_m"] == row["final_x_e_m"]
    assert min(one["margin"] for one in summary["expectations"]) == row["margin"]
    assert not Record.open(job.folder / RECORD).lost
    assert missing_of(folder, [0, 1]) == [0]


@pytest.mark.system
def test_one_that_was_stopped_leaves_no_folder_that_looks_whole(tmp_path) -> None:
    folder = study_folder(tmp_path, TEXT)
    stop = Stop()
    stop.request("now")
    assert keep_worst(plan_of(TEXT), folder, [0], stop) == []
    assert missing_of(folder, [0]) == [0]
    assert keep_worst(plan_of(TEXT), folder, [0], Stop()) == []
    assert (folder / "worst" / "case-000000" / SUMMARY).exists()
