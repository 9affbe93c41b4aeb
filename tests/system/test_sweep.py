"""Sweeps over real processes, killed here and there: no case is lost, none is done twice."""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path

import psutil
import pyarrow.parquet
import pytest
from support.certificates import certificates, sign_for
from support.sweeping import cases_in, cluster, sweeping

from fleetloop.packages import HOME, NAMES

pytestmark = [pytest.mark.system, pytest.mark.timeout(400)]

CASES = 40
STUDY = f"""
schema = 1
title = "short"
base = "two_robots"
design = "random"
cases = {CASES}
set = [
    "until_s=0.2",
    "expect.0.from_s=0.1", "expect.0.max_abs=0.2",
    "expect.1.from_s=0.1", "expect.1.max_abs=0.2",
]
[[factor]]
name = "mass_kg"
key = "robot_types.etsro.body_mass_kg"
uniform = [1.0, 4.0]
[keep]
quantities = ["peak_x_e_m"]
"""
SAID = re.compile(
    r"short: \d+ of \d+ cases.*|worker \S+ has ended.*|interrupted by .*: go on with .*"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "study.toml").write_text(STUDY, "utf-8")
    return tmp_path


THEORY = """
schema = 1
title = "against theory"
base = "two_robots"
design = "grid"
set = [
    "until_s=1.6",
    'graph={ edges = ["r1 -> r2", "r2 -> r1"], leader = ["r1"] }',
    "robot.r2.s_0=0.001",
    "expect=[]",
]
[[factor]]
key = "coordination.p"
values = [1.0, 2.0]
[keep]
quantities = []
[theory]
"""


def assert_every_case_once(out: Path, cases: int = CASES) -> None:
    assert sorted(cases_in(out)) == list(range(cases))


def assert_gone(processes: Sequence[psutil.Process], within_s: float = 5.0) -> None:
    _, alive = psutil.wait_procs(processes, timeout=within_s)
    assert alive == []


def test_a_study_against_theory_ends_with_how_many_cases_agree(tmp_path: Path) -> None:
    (tmp_path / "theory.toml").write_text(THEORY, "utf-8")
    with sweeping(tmp_path, "theory.toml", "--workers", "1", "--in-process") as sweep:
        status, out = sweep.end()
    assert status == 0
    assert "against theory: 2 of 2 cases: 2 held" in out
    assert "theory   the law as sampled: 2 of 2 cases agree, 0 disagree\n" in out
    assert "theory   (46), in continuous time: 2 of 2 cases agree, 0 disagree\n" in out
    told = json.loads((sweep.out / "sweep.json").read_text("utf-8"))
    assert [one["condition"] for one in told["theory"]] == ["sampled", "(46)"]


def test_a_worker_that_is_killed_loses_no_case_and_all_of_it_is_on_loopback(folder: Path) -> None:
    many = 4 * CASES  # one after another: both workers have some until one is killed
    slowly = ("--in-process", "--cases", str(many))
    with sweeping(folder, "study.toml", "--workers", "2", *slowly) as sweep:
        sweep.await_rows(3)
        killed = sweep.workers()[0]
        killed.suspend()  # so that it doesn't finish its cases before it is killed
        family = [sweep.main, *sweep.family()]
        places = {
            connection.laddr.ip
            for process in family
            for connection in process.net_connections()
            if connection.status == psutil.CONN_LISTEN
        }
        assert places == {"127.0.0.1"}
        killed.kill()
        status, out = sweep.end()
    assert (status, out.splitlines()[0]) == (0, f"short: {many} of {many} cases: {many} held")
    assert_every_case_once(sweep.out, many)
    said = sweep.errors.read_text().splitlines()
    assert [line for line in said if not SAID.fullmatch(line)] == []
    assert any("has ended; its cases are computed again" in line for line in said)
    assert_gone(family)


def test_a_worker_of_a_cluster_that_is_killed_loses_no_case(folder: Path) -> None:
    with (
        cluster(folder, workers=2) as dask,
        sweeping(folder, "study.toml", "--scheduler", dask.address) as sweep,
    ):
        sweep.await_rows(3)
        dask.processes[-1].kill()
        status, _ = sweep.end()
        assert dask.processes[0].poll() is None  # what the user has goes on
    assert status == 0
    assert_every_case_once(sweep.out)


def test_a_cluster_with_certificates_serves_who_has_one_of_its_authority(folder: Path) -> None:
    certificates(folder, ("head", "me"))
    (folder / "other").mkdir()
    certificates(folder / "other", ("me",), authority="other")
    ours = ("--tls-ca", "ca.pem", "--tls-cert", "me.pem", "--tls-key", "me.key")
    foreign = ("--tls-ca", "ca.pem", "--tls-cert", "other/me.pem", "--tls-key", "other/me.key")
    with cluster(folder, workers=1, tls=("ca.pem", "head.pem", "head.key")) as dask:
        assert dask.address.startswith("tls://127.0.0.1:")
        where = ("study.toml", "--scheduler", dask.address)
        with sweeping(folder, *where, *foreign, out="refused") as sweep:
            assert sweep.end()[0] == 3
        assert not sweep.out.exists()
        refusal = f"{dask.address}: answers, but not as a Dask scheduler with TLS"
        assert refusal in sweep.errors.read_text().splitlines()[-1]
        with sweeping(folder, *where, *ours) as sweep:
            status, out = sweep.end()
    assert (status, out.splitlines()[0]) == (0, f"short: {CASES} of {CASES} cases: {CASES} held")
    assert_every_case_once(sweep.out)


def test_the_command_of_a_row_runs_its_case_from_any_folder(folder: Path, tmp_path: Path) -> None:
    own, elsewhere = folder / "own", tmp_path / "elsewhere"
    own.mkdir()
    elsewhere.mkdir()
    shutil.copy(HOME / "configs" / "two_robots.toml", own / "base.toml")
    (own / "study.toml").write_text(STUDY.replace('"two_robots"', '"base.toml"'), "utf-8")
    with sweeping(folder, "own/study.toml", "--workers", "1", "--cases", "1") as sweep:
        assert sweep.end()[0] == 0
    (row,) = pyarrow.parquet.read_table(sweep.out / "parts").to_pylist()
    program, *words = shlex.split(row["command"])
    assert program == "fleetloop"
    subprocess.run(
        [sys.executable, "-m", "fleetloop", *words],
        cwd=elsewhere,
        check=True,
        capture_output=True,
        timeout=100,
    )


@pytest.mark.parametrize(
    ("begins", "ends", "said"),
    [
        (timedelta(days=-9), timedelta(days=-2), "certificate has expired"),
        (timedelta(days=2), timedelta(days=9), "certificate is not yet valid"),
    ],
    ids=["expired", "not yet valid"],
)
def test_a_scheduler_whose_certificate_is_not_good_now_is_named_so(
    folder: Path, begins: timedelta, ends: timedelta, said: str
) -> None:
    certificates(folder, ("head", "me"))
    sign_for(folder, "head", begins=begins, ends=ends)
    ours = ("--tls-ca", "ca.pem", "--tls-cert", "me.pem", "--tls-key", "me.key")
    with cluster(folder, workers=0, tls=("ca.pem", "head.pem", "head.key")) as dask:
        where = ("study.toml", "--scheduler", dask.address)
        with sweeping(folder, *where, *ours) as sweep:
            status, _ = sweep.end()
    refusal = f"{dask.address}: its certificate can't be trusted: {said}"
    assert status == 3
    assert sweep.errors.read_text().splitlines()[-1] == f"fleetloop: --scheduler {refusal}"
    assert not sweep.out.exists()


def test_a_cluster_without_workers_is_said_to_be_waited_for(folder: Path) -> None:
    with (
        cluster(folder, workers=0) as dask,
        sweeping(folder, "study.toml", "--scheduler", dask.address) as sweep,
    ):
        status, _ = sweep.end()
    said = sweep.errors.read_text().splitlines()
    waits = re.compile(rf"(fleetloop: )?waits for a worker at {dask.address}, \d+ s more")
    assert len([line for line in said if waits.fullmatch(line)]) >= 5
    assert said[-1] == (
        f"fleetloop: --scheduler {dask.address}: no worker for 60 s; start one with"
        f" dask worker {dask.address}"
    )
    assert status == 3
    assert not sweep.out.exists()


def test_a_worker_that_says_nothing_is_named_within_a_bound(folder: Path) -> None:
    with cluster(folder, workers=1) as dask:
        dask.await_workers(1)
        dask.processes[1].send_signal(signal.SIGSTOP)
        with sweeping(folder, "study.toml", "--scheduler", dask.address) as sweep:
            status, _ = sweep.end()
    said = sweep.errors.read_text().splitlines()[-1]
    assert status == 3
    assert re.fullmatch(r"fleetloop: worker tcp://\S+ doesn't answer: no answer in 20 s", said)
    assert not sweep.out.exists()


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
def test_a_scheduler_that_goes_leaves_a_study_that_goes_on_here(
    folder: Path, end: signal.Signals
) -> None:
    many = STUDY.replace(f"cases = {CASES}", "cases = 2000")
    (folder / "many.toml").write_text(many, "utf-8")
    with (
        cluster(folder, workers=1) as dask,
        sweeping(folder, "many.toml", "--scheduler", dask.address) as sweep,
    ):
        sweep.await_rows(3)
        dask.processes[0].send_signal(end)
        status, _ = sweep.end()
    assert status == 3
    assert "the scheduler has gone" in sweep.errors.read_text().splitlines()[-1]
    some = cases_in(sweep.out)
    assert sorted(set(some)) == sorted(some)
    with sweeping(folder, "--resume", "out", "--workers", "1", "--cases", "2000") as again:
        again.await_rows(len(some) + 1)
        again.interrupt()
        assert again.end()[0] == 130


def test_a_command_that_is_killed_leaves_no_process_and_its_study_goes_on(folder: Path) -> None:
    with sweeping(folder, "study.toml", "--workers", "2") as sweep:
        sweep.await_rows(3)
        family = sweep.family()
        sweep.kill()
        sweep.end()
        assert_gone(family)
    assert "resource_tracker" not in sweep.errors.read_text()
    before = {part.name: part.read_bytes() for part in (sweep.out / "parts").glob("part-*.parquet")}
    done = len(cases_in(sweep.out))
    assert 3 <= done < CASES
    with sweeping(folder, "--resume", "out", "--json") as again:
        status, out = again.end()
    assert status == 0
    assert_every_case_once(sweep.out)
    assert f'"computed": {CASES - done},' in out
    after = {name: (sweep.out / "parts" / name).read_bytes() for name in before}
    assert after == before


def test_ctrl_c_keeps_what_is_done_and_leaves_no_process(folder: Path) -> None:
    with sweeping(folder, "study.toml", "--workers", "2") as sweep:
        sweep.await_rows(3)
        family = sweep.family()
        sweep.interrupt()
        status, out = sweep.end()
        assert_gone(family)
    said = sweep.errors.read_text().splitlines()
    assert status == 130
    assert "interrupted by SIGINT: go on with fleetloop sweep --resume out" in said
    assert [line for line in said if not SAID.fullmatch(line)] == []
    done = cases_in(sweep.out)
    assert len(done) == len(set(done)) >= 3
    assert out.startswith(f"short: {len(done)} of {CASES} cases: {len(done)} held")


def test_ctrl_c_while_workers_start_and_again_ends_it_all_without_a_traceback(folder: Path) -> None:
    with sweeping(folder, "study.toml", "--workers", "2") as sweep:
        sweep.await_workers(2)
        family = sweep.family()
        for _ in range(3):
            sweep.interrupt()
        status, _ = sweep.end()
        assert_gone(family)
    said = sweep.errors.read_text().splitlines()
    assert status == 130
    assert [line for line in said if not SAID.fullmatch(line)] == []


MORTAL = '''
import os
import signal

from agents.laws.adaptive_dsc import AdaptiveDsc


class Mortal(AdaptiveDsc):
    """Kills its process, or takes all its memory."""

    def __init__(self, gains, *args, **kwargs):
        super().__init__(gains, *args, **kwargs)
        self.deadly, self.lot = gains.k1, []

    def step(self, *args, **kwargs):
        if self.deadly == 7.0:
            os.kill(os.getpid(), signal.SIGKILL)
        if self.deadly == 8.0:
            self.lot.append(bytearray(b"x" * (8 << 20)))
        return super().step(*args, **kwargs)
'''
DEADLY = """
schema = 1
title = "short"
base = "two_robots"
design = "grid"
set = [
    "until_s=0.4", "control.law=mortal:Mortal",
    "expect.0.from_s=0.1", "expect.0.max_abs=0.2",
    "expect.1.from_s=0.1", "expect.1.max_abs=0.2",
]
[[factor]]
key = "control.k1"
values = [{values}]
[keep]
quantities = []
"""


@pytest.mark.parametrize(("deadly", "more"), [(7.0, ()), (8.0, ("--memory", "600MiB"))])
def test_a_case_that_ends_its_worker_is_an_error_and_the_others_are_done(
    folder: Path, deadly: float, more: tuple[str, ...]
) -> None:
    (folder / "mortal.py").write_text(MORTAL, "utf-8")
    values = [2.0 + 0.01 * n for n in range(11)] + [deadly]
    text = DEADLY.format(values=", ".join(f"{value:.2f}" for value in values))
    (folder / "deadly.toml").write_text(text, "utf-8")
    with sweeping(folder, "deadly.toml", "--workers", "2", *more) as sweep:
        status, out = sweep.end()
    assert status == 1
    assert out.startswith("short: 12 of 12 cases: ")
    assert_every_case_once(sweep.out, 12)
    rows = pyarrow.parquet.read_table(sweep.out / "parts").to_pylist()
    verdicts = {row["k1"]: row["verdict"] for row in rows}
    assert [k1 for k1, verdict in verdicts.items() if verdict == "error"] == [deadly]
    (reason,) = (row["reason"] for row in rows if row["verdict"] == "error")
    assert reason.startswith("its worker ended 2 times while it computed this case alone")
    if more:
        assert "out of memory at" in sweep.errors.read_text()


def test_a_worker_of_another_program_is_refused(folder: Path) -> None:
    other = folder / "other"
    for package in ("fleetloop", *NAMES):
        shutil.copytree(HOME / package, other / package)
    with (other / "fleetloop" / "sweep" / "batch.py").open("a") as file:
        file.write("# another\n")
    with (
        cluster(folder, workers=1, PYTHONPATH=str(other)) as dask,
        sweeping(folder, "study.toml", "--scheduler", dask.address) as sweep,
    ):
        status, _ = sweep.end()
    said = sweep.errors.read_text().splitlines()[-1]
    assert status == 3
    assert re.fullmatch(
        r"fleetloop: (worker \S+ has|a worker has) other versions: sources \w+, here \w+.*", said
    )
    assert not os.path.exists(sweep.out)  # noqa: PTH110


def test_where_no_scheduler_is_nothing_is_begun(folder: Path) -> None:
    with sweeping(folder, "study.toml", "--scheduler", "tcp://127.0.0.1:1") as sweep:
        status, _ = sweep.end()
    said = sweep.errors.read_text().splitlines()[-1]
    assert status == 3
    assert (
        said == "fleetloop: --scheduler tcp://127.0.0.1:1: no scheduler there: Connection refused"
    )
    assert not sweep.out.exists()


RATE = """
schema = 1
title = "short"
base = "two_robots"
design = "random"
cases = 40000
set = ["until_s=0.1", "expect.0.from_s=0.05", "expect.1.from_s=0.05"]
{more}
[[factor]]
key = "expect.0.max_abs"
uniform = [{least}, 0.2]
[keep]
quantities = []
[stop]
failure_rate_within = 0.2
least_cases = 10
"""


def test_a_study_ends_when_its_failure_rate_is_known_and_goes_on_when_asked(folder: Path) -> None:
    (folder / "rate.toml").write_text(RATE.format(more="", least=0.0), "utf-8")
    with sweeping(folder, "rate.toml", "--json") as sweep:
        status, out = sweep.end()
    told = json.loads(out)
    least, most = told["failure_rate_interval"]
    assert status == 0
    assert told["done"] < told["cases"] == 40_000
    assert told["ended"].startswith("the failure rate is ")
    assert 0.5 * (most - least) <= 0.2
    assert least < 0.5 < most  # |x_e| is 0.1 m, the bound is drawn from 0 to 0.2 m
    assert told["counts"]["failed"] + told["counts"]["held"] == told["done"]
    assert len(cases_in(sweep.out)) == told["done"]
    assert json.loads((sweep.out / "sweep.json").read_text())["done"] == told["done"]


def test_an_invalid_case_ends_a_study_that_asks_for_that(folder: Path) -> None:
    text = RATE.format(more='invalid = "stop"', least=-5.0)
    (folder / "rate.toml").write_text(text, "utf-8")
    with sweeping(folder, "rate.toml") as sweep:
        status, _ = sweep.end()
    said = sweep.errors.read_text().splitlines()[-1]
    assert status == 2
    assert re.match(r"fleetloop: case \d+: max_abs = -\d\.\d+: must be 0 or more", said)
    assert cases_in(sweep.out)
