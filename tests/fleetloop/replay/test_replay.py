"""Replays of runs in one process: identical code gives identical bits, other code says where."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from configs.errors import ScenarioError
from configs.loading import load, to_toml
from fleetloop.launch.run import RunOptions, run_scenario
from fleetloop.record.inputs_file import InputsFile, path_of, read_inputs
from fleetloop.replay.changes import brief_of
from fleetloop.replay.command import ReplayOptions, replay_run
from fleetloop.replay.player import play
from fleetloop.replay.repeat import repeated_inputs
from fleetloop.results import run_folder
from fleetloop.results.divergence import Tolerance
from fleetloop.results.run_folder import IncompleteError, read_record

SHORT = ("until_s=0.4", "expect=[]")


def made(out: Path, *overrides: str) -> Path:
    options = RunOptions(
        in_process=True, out=out, overrides=(*SHORT, *overrides), figures=False, as_json=True
    )
    assert run_scenario("two_robots", options) == 0
    return out


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with inputs."""
    return made(tmp_path_factory.mktemp("run") / "a", "record.inputs=true")


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run without inputs."""
    return made(tmp_path_factory.mktemp("run") / "b")


@pytest.mark.parametrize("robot", ["r1", "r2"])
def test_the_same_code_gives_the_same_bits(run: Path, robot: str, capsys) -> None:
    assert replay_run(run, ReplayOptions(robot=robot)) == 0
    out = capsys.readouterr().out
    assert "identical: 200 ticks, 35 signals and 664 sent frames, bit for bit" in out
    assert "open loop" not in out


def test_a_lockstep_run_without_inputs_is_repeated_to_have_them(without: Path, capsys) -> None:
    assert replay_run(without, ReplayOptions(robot="r2", as_json=True)) == 0
    said = capsys.readouterr()
    assert "has no inputs; a lockstep run can be repeated" in said.err
    assert json.loads(said.out)["identical"] is True


def test_an_interrupted_run_is_repeated_as_far_as_its_record_goes(without: Path) -> None:
    whole = read_record(without, partial=False)
    first = {robot: rows[:120] for robot, rows in whole.controller.items()}
    cut = replace(whole, controller=first, plant={it: r[:120] for it, r in whole.plant.items()})
    scenario = load("two_robots", SHORT)
    replayed = play(brief_of(scenario, "r2"), repeated_inputs(cut, scenario, "r2", quiet=True))
    assert 120 <= len(replayed.rows) <= 121
    assert replayed.rows["s"][:120].tobytes() == first["r2"]["s"].tobytes()


def test_a_run_that_does_not_come_out_again_is_not_repeated(without: Path) -> None:
    record = read_record(without, partial=False)
    record.controller["r2"]["s"][130] += 1e-12
    with pytest.raises(ScenarioError, match=r"it differs from r2, controller, tick 130 on; code"):
        repeated_inputs(record, load("two_robots", SHORT), "r1", quiet=True)


def test_another_gain_parts_where_it_acts_and_the_answer_is_open_loop(
    run: Path, capsys, tmp_path: Path
) -> None:
    out = tmp_path / "r2.png"
    options = ReplayOptions(robot="r2", sets=("control.k1=3",), out=out)
    assert replay_run(run, options) == 1
    said = capsys.readouterr().out
    assert "open loop: --set control.k1=3 on inputs that were recorded without" in said
    assert "different from tick 0 (t = 0.000 s) of 200 on: alpha_v_m_s 0.3000" in said
    assert "frames sent at 200 ticks differ, first at tick 0: 00E#" in said
    assert "tau_right_wheel_N_m" in said
    assert out.read_bytes().startswith(b"\x89PNG")
    # What the recorded motion alone decides stays as it was.
    assert replay_run(run, ReplayOptions(robot="r2", sets=("control.k1=3",), as_json=True)) == 1
    signals = {one["signal"] for one in json.loads(capsys.readouterr().out)["signals"]}
    assert "tau_left_wheel_N_m" in signals
    assert not signals & {"x_used_m", "s", "mu", "v_r_hat", "x_e_m", "neighbours"}


def test_within_a_tolerance_another_gain_is_no_difference(run: Path, capsys) -> None:
    options = ReplayOptions(
        robot="r2", sets=("control.k1=2.0000001",), tolerance=Tolerance.parse(["0.001"])
    )
    assert replay_run(run, options) == 0
    assert "within the tolerance: 200 ticks" in capsys.readouterr().out


def test_another_law_records_other_signals_and_brings_its_gains(run: Path, capsys) -> None:
    options = ReplayOptions(robot="r1", law="backstepping_numeric", as_json=True)
    assert replay_run(run, options) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["open_loop"]
    assert "theta_hat_1" in said["only_recorded"]
    assert {one["signal"] for one in said["signals"]} >= {"tau_right_wheel_N_m"}


OWN_LAW = '''
from agents.laws.adaptive_dsc import AdaptiveDsc


class Mine(AdaptiveDsc):
    """The paper's law, by another name."""
'''


@pytest.mark.parametrize("path", ["my_law:Mine", "my_law.py:Mine"])
def test_a_law_of_ones_own_is_named_by_its_file(
    run: Path, tmp_path: Path, path: str, capsys
) -> None:
    (tmp_path / "my_law.py").write_text(OWN_LAW)
    assert replay_run(run, ReplayOptions(robot="r1", law=f"{tmp_path}/{path}")) == 0
    assert "identical: 200 ticks" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (ReplayOptions(robot="r9"), r"--robot r9: not in .*; there are r1, r2"),
        (ReplayOptions(robot="r1", law="nonsense"), r"--law nonsense: .*no such law"),
        (ReplayOptions(robot="r1", sets=("control.k99=1",)), r"--set control.k99=1: unknown key"),
        (
            ReplayOptions(robot="r1", sets=("control.k1=3", "robot.r2.pose.x_m=1.9")),
            r"--set robot.r2.pose.x_m=1.9: changes nothing for the controller of r1",
        ),
        (
            ReplayOptions(robot="r1", sets=("clock.share_period_s=0.04",)),
            r"the recorded inputs came by the record's schedule",
        ),
        (
            ReplayOptions(robot="r1", sets=('graph.edges=["r1 -> r2", "r2 -> r1"]',)),
            r"needs path states of r2, which did not reach r1",
        ),
        (
            ReplayOptions(robot="r2", sets=('graph.leader=["r1", "r2"]',)),
            r"needs the speed of the leader, which did not reach r2",
        ),
        (ReplayOptions(robot="r1", out=Path("a.gif")), r"--out a.gif: the ending must be .png"),
        (
            ReplayOptions(robot="r1", tolerance=Tolerance.parse(["nope=1"])),
            r"--tolerance nope: no such signal; there are .*theta_hat_1",
        ),
        (
            ReplayOptions(robot="r1", out=Path("a.png"), signals=("nope",)),
            r"--signals nope: no such signal; there are tick, t_s",
        ),
    ],
)
def test_what_a_replay_cannot_show_is_refused(run: Path, options: ReplayOptions, said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        replay_run(run, options)


def test_weights_of_the_graph_are_parameters_of_the_controller(run: Path, capsys) -> None:
    weaker = ReplayOptions(robot="r2", sets=('graph.weights={"r1 -> r2"=0.5}',), as_json=True)
    assert replay_run(run, weaker) == 1
    signals = {one["signal"] for one in json.loads(capsys.readouterr().out)["signals"]}
    assert {"s", "mu"} <= signals


def test_inputs_that_are_cut_give_as_many_ticks_and_say_so(
    run: Path, tmp_path: Path, capsys
) -> None:
    shutil.copytree(run, tmp_path / "cut")
    (log,) = read_inputs(path_of(run, "r1"))
    file = InputsFile(path_of(tmp_path / "cut", "r1"))
    file.write(0, log.entries[: len(log.entries) * 2 // 3], final=False)
    file.close()
    assert replay_run(tmp_path / "cut", ReplayOptions(robot="r1")) == 0
    said = capsys.readouterr()
    assert "1 of its 1 logs end before their controller did" in said.err
    assert "recorded ticks have no inputs, and were left out" in said.out
    assert "bit for bit" in said.out


def test_a_cut_record_is_refused_unless_asked_for(run: Path, tmp_path: Path, capsys) -> None:
    shutil.copytree(run, tmp_path / "cut")
    record = tmp_path / "cut" / "record.mcap"
    record.write_bytes(record.read_bytes()[:-2000])
    with pytest.raises(IncompleteError, match="--partial takes that"):
        replay_run(tmp_path / "cut", ReplayOptions(robot="r1"))
    replayed = replay_run(tmp_path / "cut", ReplayOptions(robot="r1", partial=True))
    assert replayed == 0, capsys.readouterr().out


def test_a_real_time_run_without_inputs_cannot_be_replayed(
    without: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = read_record(without, partial=False)
    realtime = replace(
        record, scenario_toml=to_toml(load("two_robots", ("clock.mode='realtime'",)))
    )
    monkeypatch.setattr(run_folder, "read_record", lambda *_, **__: realtime)
    with pytest.raises(ScenarioError, match="a run in real time can't be repeated; run it without"):
        replay_run(without, ReplayOptions(robot="r1"))
