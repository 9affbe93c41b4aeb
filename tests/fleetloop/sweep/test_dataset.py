"""The dataset: whole parts, one row per case, what its columns are."""

import math
import os
import re
import resource
import shutil
import subprocess
import sys
from dataclasses import replace

import pandas as pd
import pyarrow.dataset
import pyarrow.parquet
import pytest
from support.studies import FEW, MASS, SHORT, P, cases_of, study_folder

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.sweep.batch import rows_of
from fleetloop.sweep.dataset import Columns, Dataset, about, read
from fleetloop.sweep.watch import Watch

GRAPH = "\n[[factor]]\ngraph = {}\n"
LAW = '\n[[factor]]\nkey = "control.law"\nvalues = ["adaptive_dsc", "adaptive_dsc_robust"]\n'
SEED = '\n[[factor]]\nkey = "seed"\nintegers = [3, 9]\n'
THREE = SHORT + 'design = "grid"\n' + P + FEW
SCHEMA = Columns(cases_of(THREE)).schema
TEXT = SHORT + 'design = "random"\ncases = 6\n' + MASS + GRAPH + LAW + SEED


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    return study_folder(tmp_path_factory.mktemp("study"), TEXT)


def test_it_has_a_row_per_case_and_a_column_per_factor_and_quantity(folder) -> None:
    table = read(folder)
    assert table.column("case").to_pylist() == list(range(6))
    types = {field.name: str(field.type) for field in table.schema}
    assert types["mass_kg"] == types["peak_s_spread"] == types["expect_2_margin"] == "double"
    assert types["law"] == types["graph"] == types["verdict"] == types["command"] == "string"
    assert types["case"] == types["seed"] == "int64"
    assert list(types).count("seed") == 1


def test_its_metadata_says_what_the_columns_are(folder) -> None:
    told = about(read(folder))
    assert told["format"] == 1
    assert told["study"] == "short"
    assert told["base"] == "two_robots"
    assert told["factors"] == ["mass_kg", "graph", "law", "seed"]
    assert told["keys"]["mass_kg"] == ["robot_types.etsro.body_mass_kg"]
    units = {one["name"]: one["unit"] for one in told["quantities"]}
    assert units["final_theta_e_rad"] == "rad"
    assert units["settle_s_of_theta_e_rad"] == "s"
    assert told["quantities"][-1]["meaning"] == "y_e_m within ±0.2 from 0.05 s"


def test_pandas_and_arrow_open_its_folder_of_parts_as_one_table(folder) -> None:
    assert len(pd.read_parquet(folder / "parts")) == 6
    assert pyarrow.dataset.dataset(folder / "parts").count_rows() == 6


def test_a_case_has_one_row_whatever_comes_twice(tmp_path) -> None:
    cases = cases_of(THREE)
    columns = Columns(cases)
    rows = rows_of(cases, range(3), Watch(300.0))
    dataset = Dataset(tmp_path, 3, SCHEMA)
    dataset.add(columns.batch(rows[:2]))
    dataset.add(columns.batch([replace(rows[1], reason="again"), rows[2]]))
    dataset.add(columns.batch(rows))
    dataset.close()
    table = read(tmp_path)
    assert table.column("case").to_pylist() == [0, 1, 2]
    assert "again" not in table.column("reason").to_pylist()


def test_who_opens_it_again_knows_what_is_done(tmp_path) -> None:
    study_folder(tmp_path, THREE, [2, 0])
    dataset = Dataset(tmp_path, 3, SCHEMA)
    assert dataset.done.tolist() == [True, False, True]
    dataset.close()


def test_one_command_at_a_time_adds_to_it(tmp_path) -> None:
    dataset = Dataset(tmp_path, 3, SCHEMA)
    with pytest.raises(ScenarioError, match="another command is at work on this study"):
        Dataset(tmp_path, 3, SCHEMA)
    dataset.close()
    Dataset(tmp_path, 3, SCHEMA).close()


def test_what_a_killed_command_left_half_written_is_no_part(tmp_path, capfd) -> None:
    study_folder(tmp_path, THREE, [0])
    study_folder(tmp_path, THREE, [1])
    one, other = sorted((tmp_path / "parts").glob("part-*"))
    shutil.copy(one, tmp_path / "parts" / ".part-unfinished.parquet")
    other.write_bytes(other.read_bytes()[:100])
    dataset = Dataset(tmp_path, 3, SCHEMA)
    dataset.close()
    assert dataset.done.tolist() == [True, False, False]
    assert sorted(path.suffix for path in (tmp_path / "parts").iterdir()) == [
        ".damaged",
        ".parquet",
    ]
    assert "damaged; its cases are computed again" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("column", "told"),
    [
        (pyarrow.array(["0", "1"]), "its columns are others"),
        (pyarrow.array([0.0, 1.0]), "its columns are others"),
        (pyarrow.array([1, None]), "has rows without a case"),
        (pyarrow.array([-3, 1]), "its cases aren't within 0 to 2"),
        (pyarrow.array([1, 10**12]), "its cases aren't within 0 to 2"),
    ],
)
def test_a_part_that_is_not_of_the_study_is_set_aside(
    tmp_path, capfd, column: pyarrow.Array, told: str
) -> None:
    study_folder(tmp_path, THREE, [0, 1])
    parts = tmp_path / "parts"
    table = read(tmp_path)
    foreign = table.set_column(0, "case", column)
    pyarrow.parquet.write_table(foreign, parts / "part-foreign.parquet")
    dataset = Dataset(tmp_path, 3, SCHEMA)
    dataset.close()
    assert dataset.done.tolist() == [True, True, False]
    assert (parts / "part-foreign.damaged").exists()
    assert told in capfd.readouterr().err
    assert read(tmp_path).equals(table)


def test_a_part_with_other_columns_is_named_where_rows_are_read(tmp_path) -> None:
    study_folder(tmp_path, THREE, [0, 1])
    foreign = pyarrow.table({"case": [7]})
    path = tmp_path / "parts" / "part-foreign.parquet"
    pyarrow.parquet.write_table(foreign, path)
    with pytest.raises(InfrastructureError, match=re.escape(str(path))):
        read(tmp_path)
    with pytest.raises(InfrastructureError, match=re.escape(str(path))):
        read(tmp_path, ["case", "verdict"])


def test_a_reason_that_is_no_utf_8_is_kept_as_it_can_be_shown(tmp_path) -> None:
    cases = cases_of(THREE)
    rows = [replace(row, reason="boom \udc80") for row in rows_of(cases, [0], Watch(300.0))]
    assert Columns(cases).batch(rows).column("reason").to_pylist() == ["boom \\udc80"]


def test_an_infinite_margin_is_kept_and_an_unknown_one_is_null(tmp_path) -> None:
    cases = cases_of(THREE)
    rows = rows_of(cases, range(3), Watch(300.0))
    rows = [replace(rows[0], margin=-math.inf), replace(rows[1], margin=None)]
    column = Columns(cases).batch([*rows, replace(rows[1], margin=math.nan)]).column("margin")
    assert column.to_pylist() == [-math.inf, None, None]


FULL = """
import sys
from pathlib import Path
from support.studies import study_folder
study_folder(Path(sys.argv[1]), sys.argv[2], [int(sys.argv[3])])
"""


def test_a_full_disk_is_named_and_what_was_there_is_kept(tmp_path) -> None:
    text = THREE
    study_folder(tmp_path, text, [0])

    def little_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path), text, "1"],
        env=os.environ | {"PYTHONPATH": "tests", "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        preexec_fn=little_room,
        timeout=60,
    )
    error = done.stderr.splitlines()[-1]
    assert "InfrastructureError" in error
    assert "part-00000001" in error
    assert f"go on with fleetloop sweep --resume {tmp_path}" in error
    assert read(tmp_path).column("case").to_pylist() == [0]
    assert [path.name for path in (tmp_path / "parts").iterdir() if path.name[0] == "."] == []


def test_without_rows_there_is_nothing_to_read(tmp_path) -> None:
    with pytest.raises(ScenarioError, match="no rows of a study there"):
        read(tmp_path)


def test_a_part_that_cannot_be_read_is_named(tmp_path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "part-0.parquet").write_bytes(b"PAR1")
    with pytest.raises(InfrastructureError, match="parts"):
        read(tmp_path)
