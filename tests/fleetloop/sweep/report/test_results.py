"""What a report reads, and what it says of folders that aren't whole."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.studies import FEW, MASS, SHORT, P, opened, study_folder
from support.study_results import Came, made_results, made_study

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.sweep.report.columns import nice_marks, unit_of, wrapped
from fleetloop.sweep.report.results import results_of

GRID = SHORT + 'design = "grid"\n' + P + FEW
LAW = '[[factor]]\nkey = "control.law"\nvalues = ["adaptive_dsc", "adaptive_dsc_robust"]\n'
LOG = '[[factor]]\nname = "stickiness"\nkeys = ["robot_types.etsro.damping_left_wheel_N_m_s"]\n'
LOG += "log_uniform = [0.001, 0.1]\n"


def test_of_a_study_that_was_run_all_columns_are_there(tmp_path) -> None:
    found = results_of(study_folder(tmp_path, GRID + LAW))
    assert len(found) == found.total == 6
    assert [one.name for one in found.factors] == ["p", "law"]
    assert found.factors[1].levels == ("adaptive_dsc", "adaptive_dsc_robust")
    assert found.failed.tolist() == [0.0] * 6
    assert np.isfinite(found.quantities[-1].values).all()
    assert not found.running
    assert found.damaged == ()


def test_units_come_from_names_or_else_from_keys(tmp_path) -> None:
    text = SHORT + 'design = "random"\ncases = 3\n' + MASS + LOG + FEW
    found = made_results(tmp_path, text, lambda _: Came())
    assert [one.label for one in found.factors] == ["mass [kg]", "stickiness [N·m·s]"]
    assert [one.log for one in found.factors] == [False, True]
    assert unit_of("gamma_1_s") == "s"
    assert unit_of("loss", ["network.default.loss.probability"]) == ""


def test_a_part_that_is_damaged_is_named_and_the_others_are_used(tmp_path) -> None:
    for n in range(3):
        made_study(tmp_path, GRID, lambda _: Came(), [n])
    first, *_ = sorted((tmp_path / "parts").glob("part-*"))
    first.write_bytes(first.read_bytes()[:50])
    found = results_of(tmp_path)
    assert found.table.column("case").to_pylist() == [1, 2]
    (told,) = found.damaged
    assert told.startswith(str(first))


def test_a_file_of_something_else_is_no_part(tmp_path) -> None:
    made_study(tmp_path, GRID, lambda _: Came())
    table = pa.table({"case": [7]})
    pq.write_table(table, tmp_path / "parts" / "part-99.parquet")
    found = results_of(tmp_path)
    assert len(found) == 3
    assert "part-99.parquet: not of a study" in found.damaged[0]


def test_if_no_part_can_be_read_there_is_no_report(tmp_path) -> None:
    made_study(tmp_path, GRID, lambda _: Came())
    for part in (tmp_path / "parts").glob("part-*"):
        part.write_bytes(b"PAR1")
    with pytest.raises(InfrastructureError, match=r"no part can be read: .*part-00000000"):
        results_of(tmp_path)


def test_a_study_at_which_a_command_is_at_work_is_running(tmp_path) -> None:
    made_study(tmp_path, GRID, lambda _: Came(), [0])
    dataset = opened(tmp_path)
    try:
        assert results_of(tmp_path).running
    finally:
        dataset.close()
    assert not results_of(tmp_path).running


def test_who_reads_keeps_nobody_from_adding(tmp_path) -> None:
    made_study(tmp_path, GRID, lambda _: Came(), [0])
    results_of(tmp_path)
    opened(tmp_path).close()


@pytest.mark.parametrize(
    ("name", "told"),
    [("nothing", "no such folder"), ("file", "is no folder"), ("empty", "no study's folder")],
)
def test_what_is_no_study_is_refused(tmp_path, name: str, told: str) -> None:
    (tmp_path / "file").write_text("", "utf-8")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ScenarioError, match=told):
        results_of(tmp_path / name)


def test_without_its_study_file_rows_are_reported_and_theory_is_not(tmp_path) -> None:
    made_study(tmp_path, GRID, lambda _: Came())
    (tmp_path / "study.toml").unlink()
    found = results_of(tmp_path)
    assert len(found) == 3
    assert found.cases is None
    assert "no study.toml" in found.no_cases


def test_of_a_case_with_two_rows_one_counts(tmp_path) -> None:
    made_study(tmp_path, GRID, lambda _: Came())
    (part,) = (tmp_path / "parts").glob("part-*")
    (tmp_path / "parts" / "part-again.parquet").write_bytes(part.read_bytes())
    assert results_of(tmp_path).table.column("case").to_pylist() == [0, 1, 2]


def test_an_unknown_column_is_refused_with_those_that_there_are(tmp_path) -> None:
    found = made_results(tmp_path, GRID + LAW, lambda _: Came())
    with pytest.raises(ScenarioError, match=r"--x lav: no such column.*law.*there are p, law"):
        found.axis("--x", "lav")
    with pytest.raises(ScenarioError, match=r"--color p: no such result.*failure_rate, margin"):
        found.result("p")


def test_a_column_that_cannot_be_an_axis_says_why(tmp_path) -> None:
    text = SHORT + 'design = "random"\ncases = 40\n' + P + "[[factor]]\ngraph = {}\n" + FEW
    text = text.replace('"two_robots"', '"paper"')
    found = made_results(tmp_path, text, lambda _: Came())
    with pytest.raises(ScenarioError, match=r"--y graph: \d+ different texts are no axis; .* p"):
        found.axis("--y", "graph")
    with pytest.raises(ScenarioError, match=r"--x margin: has one value in all cases"):
        found.axis("--x", "margin")
    with pytest.raises(ScenarioError, match=r"--color expect_1_margin: has no value in any case"):
        found.result("expect_1_margin")


@pytest.mark.parametrize(
    ("low", "high", "log", "marks"),
    [
        (0.0, 1.0, False, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (0.2, 12.0, True, [0.2, 0.5, 1.0, 2.0, 5.0, 10.0]),
        (0.001, 1000.0, True, [10.0**n for n in range(-3, 4)]),
        (2.1, 2.9, True, [2.1, 2.9]),
    ],
)
def test_marks_are_round(low: float, high: float, log: bool, marks: list[float]) -> None:
    assert nice_marks(low, high, log=log) == pytest.approx(marks)


def test_long_names_are_wrapped_behind_underscores_and_lose_nothing() -> None:
    lines = wrapped("damping_right_wheel [N·m·s]", 14)
    assert "".join(lines).replace(" ", "") == "damping_right_wheel[N·m·s]"
    assert max(map(len, lines)) <= 15
