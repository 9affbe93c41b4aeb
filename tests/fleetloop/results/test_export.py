"""Tables of a run: columns, rows, selection, and what is never overwritten or left half."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.controller_rows import COLUMNS

from configs.errors import InfrastructureError, ScenarioError
from configs.signals import PLANT_SIGNALS
from fleetloop.record.reader import Record
from fleetloop.results.export import DEFAULT, Selection, export, table

HEADER = (
    "t_s,robot,x_m,y_m,theta_rad,v_m_s,omega_rad_s,s,s_dot,v_r_hat,x_e_m,y_e_m,theta_e_rad,"
    "tau_right_wheel_N_m,tau_left_wheel_N_m"
)


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as arrays:
        return dict(arrays)


def read(path: Path) -> list[dict[str, str]]:
    with path.open() as stream:
        return list(csv.DictReader(stream))


def test_the_table_has_the_promised_columns_and_a_row_per_tick_and_robot(
    finished_run: Path, tmp_path: Path
) -> None:
    assert export(finished_run, tmp_path / "a.csv") == 4000
    assert (tmp_path / "a.csv").read_text().partition("\n")[0] == HEADER
    rows = read(tmp_path / "a.csv")
    assert len(rows) == 4000
    assert [row["robot"] for row in rows[:3]] == ["r1", "r2", "r1"]
    record = Record.open(finished_run / "record.mcap")
    row = rows[2 * 1500 + 1]
    assert float(row["t_s"]) == 3.0
    assert float(row["x_m"]) == record.plant["r2"]["x_m"][1500]
    assert float(row["tau_left_wheel_N_m"]) == record.controller["r2"]["tau_left_wheel_N_m"][1500]


def test_npz_and_csv_hold_the_same(finished_run: Path, tmp_path: Path) -> None:
    export(finished_run, tmp_path / "a.csv")
    export(finished_run, tmp_path / "a.npz")
    arrays = arrays_of(tmp_path / "a.npz")
    assert tuple(arrays) == ("t_s", "robot", *DEFAULT)
    rows = read(tmp_path / "a.csv")
    for name in arrays:
        column = [row[name] for row in rows]
        expected = column if name == "robot" else list(map(float, column))
        assert arrays[name].tolist() == expected


def test_every_robot_has_all_its_rows_after_one_controller_ended(
    uneven_run: Path, tmp_path: Path
) -> None:
    for name in ("a.csv", "a.npz"):
        assert export(uneven_run, tmp_path / name) == 4000
    arrays = arrays_of(tmp_path / "a.npz")
    record = Record.open(uneven_run / "record.mcap")
    for robot, ends in (("r1", 2000), ("r2", 1200)):
        mine = arrays["robot"] == robot
        assert np.array_equal(arrays["t_s"][mine], record.plant[robot]["t_s"])
        assert np.array_equal(arrays["x_m"][mine], record.plant[robot]["x_m"])
        assert np.array_equal(arrays["s"][mine][:ends], record.controller[robot]["s"])
        assert np.isnan(arrays["s"][mine][ends:]).all()
    last = read(tmp_path / "a.csv")[-2:]
    assert [row["robot"] for row in last] == ["r1", "r2"]
    assert last[0]["s"] != "" != last[1]["x_m"]
    assert last[1]["s"] == last[1]["tau_left_wheel_N_m"] == ""


def test_signals_robots_and_time_are_chosen(finished_run: Path, tmp_path: Path) -> None:
    chosen = Selection(("tick", "mu", "x_m"), ("r2",), from_s=1.0, to_s=1.01)
    assert export(finished_run, tmp_path / "a.csv", chosen) == 6
    rows = read(tmp_path / "a.csv")
    assert list(rows[0]) == ["t_s", "robot", "tick", "mu", "x_m"]
    assert [row["tick"] for row in rows] == [str(tick) for tick in range(500, 506)]
    assert {row["robot"] for row in rows} == {"r2"}
    record = Record.open(finished_run / "record.mcap")
    assert float(rows[5]["mu"]) == record.controller["r2"]["mu"][505]


def test_all_signals_are_every_recorded_one_once(finished_run: Path) -> None:
    columns = table(Record.open(finished_run / "record.mcap"), Selection(("all",)))
    plant = {signal.name for signal in PLANT_SIGNALS}
    assert sorted(columns) == sorted({"robot", "tick", *plant, *COLUMNS})


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        (
            Selection(signals=("x_m", "speed")),
            r"--signals speed: no such signal; there are .*v_m_s",
        ),
        (Selection(robots=("r1", "r7")), r"--robots r7: no such robot in .*; there are r1, r2"),
        (Selection(from_s=99.0), r"--from 99: no row in that time; rows are from 0 to 3.998 s"),
        (Selection(from_s=3.0, to_s=2.0), r"--from 3: must not be after --to 2"),
        (Selection(to_s=float("nan")), r"--to nan: no row"),
    ],
)
def test_what_is_not_there_is_named_with_what_is(
    finished_run: Path, tmp_path: Path, selection: Selection, message: str
) -> None:
    with pytest.raises(ScenarioError, match=message):
        export(finished_run, tmp_path / "a.csv", selection)
    assert not list(tmp_path.iterdir())


def test_an_existing_file_is_overwritten_only_by_force(finished_run: Path, tmp_path: Path) -> None:
    target = tmp_path / "a.csv"
    target.write_text("mine")
    with pytest.raises(ScenarioError, match="exists already; --force"):
        export(finished_run, target)
    assert target.read_text() == "mine"
    export(finished_run, target, force=True)
    assert target.read_text().startswith(HEADER)
    assert list(tmp_path.iterdir()) == [target]


def test_another_ending_or_a_folder_is_refused(finished_run: Path, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"must be \.csv or \.npz"):
        export(finished_run, tmp_path / "a.xlsx")
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(ScenarioError, match="is a folder"):
        export(finished_run, tmp_path / "a.csv", force=True)


def test_a_place_that_cannot_be_written_is_named(finished_run: Path, tmp_path: Path) -> None:
    with pytest.raises(InfrastructureError, match=r"can't write .*nowhere/a\.csv: No such file"):
        export(finished_run, tmp_path / "nowhere" / "a.csv")


def test_the_command_line_takes_all_of_it(finished_run: Path, tmp_path: Path) -> None:
    (tmp_path / "a.csv").touch()
    wanted = ["--signals", "mu,x_m", "--robots", "r2", "--from", "1", "--to", "1.01", "--force"]
    done = subprocess.run(
        [sys.executable, "-m", "fleetloop", "export", finished_run, "a.csv", *wanted],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONSAFEPATH": "1"},
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote a.csv: 6 rows\n", "")
    assert list(read(tmp_path / "a.csv")[0]) == ["t_s", "robot", "mu", "x_m"]


def test_a_place_that_can_not_be_written_is_named(finished_run: Path) -> None:
    target = finished_run / "record.mcap" / "out.csv"
    with pytest.raises(InfrastructureError, match=r"can't write .*out\.csv: Not a directory"):
        export(finished_run, target)
