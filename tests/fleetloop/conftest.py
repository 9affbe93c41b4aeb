"""A finished run that tests of the operator's tools look at."""

from pathlib import Path

import pytest

from fleetloop.run import Options, run_scenario


@pytest.fixture(scope="package")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "done"
    assert run_scenario("two_robots", Options(in_process=True, out=folder, as_json=True)) == 0
    return folder
