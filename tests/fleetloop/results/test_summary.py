"""Numbers of a run."""

import json
from pathlib import Path

import numpy as np
import pytest

from agents.laws.adaptive_dsc import AdaptiveDsc
from configs.expect import Expect
from configs.loading import load
from configs.signals import PATH_ERRORS
from fleetloop.record.reader import Record
from fleetloop.results.figures import all_figures, speed_estimates
from fleetloop.results.summary import RunStats, Summary, settle_s, summarise, to_json
from fleetloop.results.tables import (
    final_line,
    print_results,
    robot_rows,
    spread_line,
    trouble_lines,
)

T = np.arange(0.0, 10.0, 0.1)


def test_an_error_has_settled_when_it_is_within_the_band_and_stays_there() -> None:
    values = np.exp(-T)
    assert settle_s(T, values, 0.05) == pytest.approx(3.0)  # e^−3 < 0.05 < e^−2.9


def test_a_bump_counts_and_the_sign_does_not() -> None:
    values = np.zeros_like(T)
    values[70] = -0.2
    assert settle_s(T, values) == pytest.approx(7.1)


def test_never_outside_is_zero_and_outside_at_the_end_is_never() -> None:
    assert settle_s(T, np.zeros_like(T)) == 0.0
    assert settle_s(T, np.ones_like(T)) is None
    assert settle_s(T, np.where(T > 5, np.nan, 0.0)) is None


def test_s_dot_settles_to_the_leaders_speed_of_the_moment_or_never(finished_run: Path) -> None:
    def settle(*overrides: str) -> float | None:
        record = Record.open(finished_run / "record.mcap")
        summary = summarise(record, load("two_robots", overrides), RunStats("lockstep"))
        return summary["robots"]["r1"]["settle_s_dot_s"]

    rows = Record.open(finished_run / "record.mcap").controller["r1"]
    outside = rows["t_s"][np.abs(rows["s_dot"] - load("two_robots").leader.speed_m_s) > 0.05]
    assert settle() == (outside[-1] if len(outside) else 0.0)
    # Steady, but at a speed that nobody asked for.
    assert settle("leader.speed_m_s=2.0") is None
    assert settle("leader.steps=[{t_s=3.0, speed_m_s=2.0}]") is None


def test_rows_that_did_not_come_are_left_out_and_others_that_are_no_numbers_are_not(
    finished_run: Path,
) -> None:
    def summary(lost: slice, *signals: str) -> Summary:
        record = Record.open(finished_run / "record.mcap")
        rows = record.controller["r1"].copy()
        for name in signals:
            rows[name][lost] = np.nan
        record.controller["r1"] = rows
        return summarise(record, load("two_robots"), RunStats("realtime"))

    whole = summary(slice(0, 0))
    ticks = whole["robots"]["r1"]["ticks"]
    middle = slice(ticks // 2, ticks // 2 + 100)
    cut = summary(middle, *(name for name in ("s", "s_dot", "x_e_m", "tau_right_wheel_N_m")))
    assert cut["robots"]["r1"]["ticks"] == ticks
    assert cut["robots"]["r1"]["final_max"] == whole["robots"]["r1"]["final_max"]
    assert np.isfinite(cut["robots"]["r1"]["peak_torque_wheel_N_m"])
    assert np.isfinite(cut["s_spread"]["peak"])
    diverged = summary(middle, "tau_right_wheel_N_m")
    assert np.isnan(diverged["robots"]["r1"]["peak_torque_wheel_N_m"])


def test_a_figure_of_the_speeds_draws_the_leaders_steps_and_ramps(finished_run: Path) -> None:
    record = Record.open(finished_run / "record.mcap")
    steps = "leader.steps=[{t_s=1.0, speed_m_s=0.2, ramp_s=1.5}, {t_s=3.0, speed_m_s=0.5}]"
    (axes,) = speed_estimates(record, load("two_robots", [steps])).axes
    (line,) = [line for line in axes.lines if line.get_label().startswith("leader")]
    t_s, v_r = line.get_data()
    at = np.interp([0.5, 1.75, 2.5, 2.9, 3.1], t_s, v_r)
    assert at == pytest.approx([0.6, 0.4, 0.2, 0.2, 0.5], abs=1e-6)


def uneven(run: Path, *expect: Expect) -> Summary:
    scenario = load("two_robots").model_copy(update={"expect": expect})
    return summarise(Record.open(run / "record.mcap"), scenario, RunStats("lockstep"))


def test_every_robot_is_judged_by_all_its_own_rows(uneven_run: Path, finished_run: Path) -> None:
    summary = uneven(uneven_run)
    assert summary["ticks"] == 2000
    assert {robot: values["ticks"] for robot, values in summary["robots"].items()} == {
        "r1": 2000,
        "r2": 1200,
    }
    assert summary["robots"]["r1"] == uneven(finished_run)["robots"]["r1"]
    assert summary["robots"]["r2"] != uneven(finished_run)["robots"]["r2"]


def test_what_a_value_is_of_is_said(uneven_run: Path, finished_run: Path) -> None:
    summary = uneven(uneven_run)
    assert [row[0] for row in robot_rows(summary)] == ["r1", "r2 to 2.4 s", "worst"]
    assert spread_line(summary).startswith("spread of s up to 2.4 s: peak ")
    whole = uneven(finished_run)
    assert [row[0] for row in robot_rows(whole)] == ["r1", "r2", "worst"]
    assert spread_line(whole).startswith("spread of s: peak ")
    assert final_line(whole) == "final: greatest magnitude in the last 4 s"


def test_a_robot_counts_while_it_is_a_member(finished_run: Path) -> None:
    members = "robot.r1.leaves_at_s=2.4", "robot.r2.joins_at_s=0.8", "robot.r2.v_m_s=0.0"
    record = Record.open(finished_run / "record.mcap")
    broken, fine = {"max_abs": 1e-12}, {"max_abs": 1e3}
    expect = (
        Expect(signal="x_e_m", from_s=3.0, **fine),
        Expect(signal="s_spread", from_s=2.5, max=0.0),
        Expect(signal="s_spread", from_s=0.0, max=0.0),
        Expect(signal="x_e_m", from_s=0.0, to_s=0.5, robots=("r1",), **broken),
    )
    scenario = load("two_robots", members).model_copy(update={"expect": expect})
    summary = summarise(record, scenario, RunStats("lockstep"))
    assert [item["held"] for item in summary["expectations"]] == [True, True, False, False]
    robots = summary["robots"]
    assert (robots["r1"]["left_s"], robots["r2"]["joined_s"]) == (2.4, 0.8)
    assert robots["r1"]["final_from_s"] == 0.0
    assert robots["r2"]["final_from_s"] == 0.8
    s = [record.controller[robot]["s"] for robot in ("r1", "r2")]
    both = slice(round(0.8 / 0.002), round(2.4 / 0.002))
    assert summary["s_spread"]["peak"] == np.abs(s[0] - s[1])[both].max()
    assert [row[0] for row in robot_rows(summary)] == ["r1 to 2.4 s", "r2", "worst"]
    assert spread_line(summary).startswith("spread of s: peak ")


def test_a_stop_is_told_once(finished_run: Path) -> None:
    summary = uneven(finished_run)
    summary["stopped_robots"] = {"r1": "tick 3 (t = 0.006 s): no encoder frames any more"}
    notices = [
        "tick 2 (t = 0.004 s): odd",
        "tick 3 (t = 0.006 s): stopped: no encoder frames any more",
    ]
    summary["notices"] = {"r1": notices}
    assert list(trouble_lines(summary)) == [
        "STOPPED r1: tick 3 (t = 0.006 s): no encoder frames any more",
        "r1: tick 2 (t = 0.004 s): odd",
    ]


def test_a_narrow_terminal_gets_every_figure(finished_run: Path, monkeypatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    print_results(uneven(finished_run), finished_run)
    shown = capsys.readouterr().out
    assert "…" not in shown
    assert all(cell in shown for row in robot_rows(uneven(finished_run)) for cell in row)


def test_an_expectation_needs_rows_of_every_robot_that_it_is_about(uneven_run: Path) -> None:
    late = {"signal": "x_e_m", "from_s": 3.0}
    fine, broken = {"max_abs": 1e3}, {"max_abs": 1e-12}
    held = [
        item["held"]
        for item in uneven(
            uneven_run,
            Expect(**late, **fine),
            Expect(**late, **broken),
            Expect(**late, **fine, robots=("r1",)),
            Expect(**late, **fine, robots=("r2",)),
            Expect(signal="x_e_m", from_s=2.0, **fine),
            Expect(signal="x_e_m", from_s=2.0, to_s=2.398, **fine),
            Expect(signal="x_e_m", from_s=2.0, to_s=2.4, **fine),
            Expect(signal="x_m", from_s=3.0, **fine),
            Expect(signal="s_spread", from_s=3.0, **fine),
        )["expectations"]
    ]
    assert held == [None, False, True, None, None, True, None, True, None]


def test_figures_show_every_robot_up_to_its_own_end(uneven_run: Path) -> None:
    record = Record.open(uneven_run / "record.mcap")
    figures = {item.name: item.figure for item in all_figures(record, load("two_robots"))}
    lines = {line.get_label(): line for line in figures["path_variables"].axes[0].lines}
    assert lines["r1"].get_xdata()[-1] == record.controller["r1"]["t_s"][-1]
    assert lines["r2"].get_xdata()[-1] == record.controller["r2"]["t_s"][-1]
    (edge,) = figures["parameter_errors"].axes[0].lines[:1]
    assert edge.get_xdata()[-1] == record.controller["r2"]["t_s"][-1]


def test_every_signal_of_the_law_has_a_panel_with_its_unit(uneven_run: Path) -> None:
    record = Record.open(uneven_run / "record.mcap")
    figures = {item.name: item.figure for item in all_figures(record, load("two_robots"))}
    panels = {axes.get_title(): axes for axes in figures["law_signals"].axes if axes.lines}
    own = [signal for signal in AdaptiveDsc.SIGNALS if signal not in PATH_ERRORS]
    assert list(panels) == [f"{signal.name} [{signal.unit}]" for signal in own]
    for axes in panels.values():
        ends = [line.get_xdata()[-1] for line in axes.lines]
        assert ends == [record.controller[robot]["t_s"][-1] for robot in ("r1", "r2")]


def test_figures_bear_a_robot_without_any_row(uneven_run: Path) -> None:
    record = Record.open(uneven_run / "record.mcap")
    record.plant["r2"], record.controller["r2"] = (
        record.plant["r2"][:0],
        record.controller["r2"][:0],
    )
    assert len(all_figures(record, load("two_robots"))) == 10


def test_what_is_no_number_is_null_in_the_file_and_said_in_the_table() -> None:
    errors = dict.fromkeys(("x_e_m", "y_e_m", "theta_e_rad"), None)
    robot = {
        "settle_s": errors,
        "final_max": dict.fromkeys(errors, np.nan),
        "peak_torque_wheel_N_m": 0.0,
    }
    robot |= {"ticks": 1}
    said = {
        "ticks": 1,
        "simulated_s": 0.1,
        "robots": {"r1": robot},
        "found": [np.inf, 1.0, "text", None],
    }
    read = json.loads(to_json(said), parse_constant=pytest.fail)
    assert read["found"] == [None, 1.0, "text", None]
    assert read["robots"]["r1"]["final_max"] == errors
    for summary in (said, read):
        assert next(iter(robot_rows(summary)))[4:] == ["no number"] * 3 + ["0.00"]


@pytest.mark.parametrize("value", [1e308, -1e308, np.inf, np.nan])
def test_figures_bear_a_motion_that_diverged(finished_run: Path, value: float) -> None:
    record = Record.open(finished_run / "record.mcap")
    for rows in (record.plant["r1"], record.controller["r1"]):
        for name in rows.dtype.names[2:]:
            rows[name][1500:] = value
    for item in all_figures(record, load("two_robots")):
        item.figure.draw_without_rendering()
