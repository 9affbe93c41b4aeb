"""`Run`: the signals, events and verdict of a run's folder, by name."""

from pathlib import Path

import numpy as np
import pytest

import fleetloop
from configs.signals import Signal
from fleetloop import NotHeldError, Run, ScenarioError
from fleetloop.record.reader import Record
from fleetloop.results.run_folder import IncompleteError

PUSH = {"kind": "push", "name": "shove", "robots": ["r1"], "at_s": 0.2, "for_s": 0.1}
NEVER = {"name": "never <b>", "signal": "x_e_m", "max_abs": 1e-9, "from_s": 0.1}


@pytest.fixture(scope="module")
def run() -> Run:
    scenario = fleetloop.load("two_robots").with_(until_s=0.5, fault=[PUSH], expect=[NEVER])
    return fleetloop.run(scenario)


def test_signals_of_a_robot_are_those_of_the_record(run: Run) -> None:
    record = Record.open(run.folder / "record.mcap")
    assert run.robots == record.robots == ("r1", "r2")
    assert np.array_equal(run["r1"].x_m, record.plant["r1"]["x_m"])
    assert np.array_equal(run["r2"]["s"], record.controller["r2"]["s"])
    assert run.t_s.shape == run["r1"].t_s.shape == (250,)
    assert run.t_s[1] == pytest.approx(0.002)


def test_signals_of_the_fleet_have_a_column_per_robot_or_pair(run: Run) -> None:
    x_e = run.signal("x_e_m")
    assert x_e.shape == (250, 2)
    assert np.array_equal(x_e[:, 1], run["r2"].x_e_m)
    s = run.signal("s")
    assert run.signal("s_spread") == pytest.approx(s.max(axis=1) - s.min(axis=1))
    apart = np.hypot(run["r1"].x_m - run["r2"].x_m, run["r1"].y_m - run["r2"].y_m)
    assert run.pairs == (("r1", "r2"),)
    assert run.signal("robot_distance_m")[:, 0] == pytest.approx(apart)
    assert run["r1"].path_distance_m.max() < 0.2


def test_a_signal_tells_its_unit_and_meaning(run: Run) -> None:
    assert (run.units["x_m"], run.units["s_spread"], run.units["neighbours"]) == ("m", "m", "1")
    assert run.signals["x_m"] == Signal("x_m", "m", "true position, world")
    assert {*run["r1"]} <= {*run.signals}
    assert "theta_e_rad" in dir(run["r1"])


def test_a_robot_that_ended_early_has_nan_from_there_on(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = Record.open

    def shorter(path: Path, *, damaged: bool = False) -> Record:
        record = opened(path, damaged=damaged)
        record.controller["r2"] = record.controller["r2"][:100]
        return record

    monkeypatch.setattr(Record, "open", shorter)
    cut = Run(run.folder)
    assert np.isnan(cut.signal("x_e_m")[100:, 1]).all()
    assert np.isfinite(cut.signal("x_e_m")[:100]).all()
    assert np.isfinite(cut["r2"].x_m).all()
    assert np.isnan(cut.signal("s_spread")[100:]).all()


def test_arrays_are_not_written_by_mistake(run: Run) -> None:
    with pytest.raises(ValueError, match="read-only"):
        run["r1"].x_m[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        run.signal("x_m")[0] = 1.0


def test_names_that_are_not_there_come_with_those_that_are(run: Run) -> None:
    with pytest.raises(KeyError, match="no robot 'r9' in this run; there are r1, r2"):
        run["r9"]
    with pytest.raises(KeyError, match="no signal 'xe_m'; did you mean x_e_m"):
        run.signal("xe_m")
    with pytest.raises(AttributeError, match="no signal 'x' of r1; there are"):
        run["r1"].x  # noqa: B018
    with pytest.raises(KeyError, match="no signal 's_spread' of r1"):
        run["r1"]["s_spread"]
    assert not hasattr(run["r1"], "_repr_html_")


def test_events_faults_and_expectations_are_typed(run: Run) -> None:
    assert [(e.t_s, e.source, e.kind) for e in run.events if e.t_s >= 0.0] == [
        (0.2, "r1", "fault_applied"),
        (0.3, "r1", "fault_cleared"),
    ]
    (fault,) = run.faults
    assert (fault.name, fault.kind, fault.from_s, fault.to_s) == ("shove", "push", 0.2, 0.3)
    (expectation,) = run.expectations
    assert (expectation.name, expectation.held) == ("never <b>", False)
    assert expectation.worst is not None
    assert expectation.worst.t_s is not None
    assert run.summary.worst is not None
    assert run.summary.worst.final_max["x_e_m"] == pytest.approx(np.abs(run.signal("x_e_m")).max())
    assert run.summary.frames_per_bus.keys() == {"r1", "r2"}


def test_the_verdict_says_what_did_not_hold_and_where(run: Run) -> None:
    assert (run.verdict, run.held) == ("failed", False)
    assert run.why.startswith(
        "FAILED       never <b>: x_e_m within ±1e-09 from 0.1 s: found -0.086 m (r1)"
    )
    with pytest.raises(NotHeldError) as caught:
        run.raise_for_verdict()
    assert str(caught.value) == f"two_robots: failed\n{run.why}"


def test_a_run_that_expects_nothing_or_was_cut_on_purpose_may_pass() -> None:
    scenario = fleetloop.load("two_robots").with_(until_s=0.1)
    unchecked = fleetloop.run(scenario)
    assert unchecked.verdict == "not checked"
    with pytest.raises(NotHeldError, match="not reached"):
        unchecked.raise_for_verdict()
    assert unchecked.raise_for_verdict(allow_unchecked=True) is unchecked
    assert fleetloop.run(scenario.with_(expect=[])).raise_for_verdict()


def test_it_shows_itself_with_the_users_words_escaped(run: Run) -> None:
    assert repr(run) == f"<Run two_robots: failed, 2 robots, 250 ticks, {run.folder}>"
    page = run._repr_html_()
    assert "<b>two_robots, in-process, 0.5 s: failed" in page
    assert "never &lt;b&gt;" in page
    assert "never <b>" not in page
    assert page.count("<tr>") == 4
    from rich.console import Console

    console = Console(width=120)
    with console.capture() as shown:
        console.print(run)
    assert "never <b>" in shown.get()


def test_a_cut_record_is_taken_when_asked_for(run: Run, tmp_path: Path) -> None:
    whole = (run.folder / "record.mcap").read_bytes()
    cut = tmp_path / "cut"
    run.save(cut)
    (cut / "record.mcap").write_bytes(whole[: len(whole) * 9 // 10])
    with pytest.raises((IncompleteError, ScenarioError), match="partial=True"):
        Run(cut)
    some = Run(cut, partial=True)
    assert np.array_equal(some["r1"].x_m, run["r1"].x_m[: len(some.t_s)])


def test_no_run_there_is_said() -> None:
    with pytest.raises(ScenarioError, match=r"nowhere: no record\.mcap there"):
        Run("nowhere")


def test_tables_hold_the_same_numbers_with_their_units(run: Run, tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    frame = run.to_pandas(["x_m", "x_e_m"])
    assert list(frame.columns) == ["t_s", "robot", "x_m", "x_e_m"]
    assert frame.attrs["units"]["x_e_m"] == "m"
    wide = frame.pivot_table("x_e_m", "t_s", "robot", observed=True)
    assert np.array_equal(wide.to_numpy(), run.signal("x_e_m"))
    assert set(run.to_pandas(robots=["r2"]).robot) == {"r2"}
    path = run.to_parquet(tmp_path / "run.parquet")
    table = parquet.read_table(path)
    assert table.schema.field("x_m").metadata[b"unit"] == b"m"
    assert table.schema.field("x_m").metadata[b"meaning"] == b"true position, world"
    assert table.num_rows == 500
    assert table.equals(run.to_arrow())
    assert pa.table(run).equals(table)  # by the protocol that polars and DuckDB use, too
    with pytest.raises(ScenarioError, match=r"signals = \['x'\]: no x in the record; there are"):
        run.to_pandas(["x"])
    with pytest.raises(ScenarioError, match=r"signals = 'x_m': a list of names"):
        run.to_pandas("x_m")


def test_figures_are_the_reports_and_show_themselves_in_a_notebook(run: Run) -> None:
    for draw in (run.plot_positions, run.plot_errors, run.plot_torques):
        figure = draw()
        assert figure.axes
    assert figure._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(ScenarioError, match="signal = 'x_m': one of x_e_m, y_e_m, theta_e_rad"):
        run.plot_errors("x_m")
