"""The command line as a user meets it; how it starts and ends, in a process of its own."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import typer
from rich.text import Text
from support.command_line import fleetloop

from configs.errors import ScenarioError
from configs.loading import load, shipped
from fleetloop.cli import app

VERBS = [command.name or command.callback.__name__ for command in app.registered_commands]
VERBS += [group.name for group in app.registered_groups]


def program(*args: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "fleetloop", *args],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"COLUMNS": "100", "PYTHONSAFEPATH": "1"},
    )


def test_help_names_every_verb_and_where_to_begin(tmp_path: Path) -> None:
    done = program("--help", cwd=tmp_path)
    assert done.returncode == 0
    for verb in VERBS:
        assert verb in done.stdout
    assert "fleetloop run paper" in done.stdout


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(verb: str, tmp_path: Path) -> None:
    done = fleetloop(tmp_path, verb, "--help")
    assert done.returncode == 0
    assert "Usage" in done.stdout


def _helps(command: Any) -> Iterator[str]:
    """The help texts of a command, its parameters and its verbs."""
    yield command.help or ""
    yield from (getattr(param, "help", None) or "" for param in command.params)
    for verb in getattr(command, "commands", {}).values():
        yield from _helps(verb)


def test_no_bracket_of_a_help_text_is_taken_for_markup() -> None:
    texts = list(_helps(typer.main.get_command(app)))
    assert any("[s]" in text for text in texts)
    assert [text for text in texts if Text.from_markup(text).spans] == []


def test_h_is_help_and_the_version_is_told(tmp_path: Path) -> None:
    assert program("run", "-h", cwd=tmp_path).stdout.count("--in-process") == 1
    done = program("--version", cwd=tmp_path)
    assert done.stdout.startswith(f"fleetloop {version('fleetloop')} (Python 3.")
    assert "--show-completion" in program("-h", cwd=tmp_path).stdout


def test_until_a_verb_is_chosen_none_of_its_libraries_is_imported() -> None:
    heavy = "{'can', 'cryptography', 'networkx', 'numpy', 'pydantic', 'rich.progress', 'zenoh'}"
    code = f"import sys, fleetloop.cli; assert not {heavy} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)


def test_a_shell_completes_the_names_of_shipped_scenarios(tmp_path: Path) -> None:
    # What click's completion script for bash asks the program.
    asked = {
        "_FLEETLOOP_COMPLETE": "complete_bash",
        "COMP_WORDS": "fleetloop run paper_",
        "COMP_CWORD": "2",
    }
    script = Path(sys.executable).with_name("fleetloop")
    done = subprocess.run(
        [script], env=os.environ | asked, cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == [name for name in shipped() if name.startswith("paper_")]


def test_check_says_what_is_wrong_in_json_too(tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "check", "paper", "--json", "--set", "control.k1=nan")
    assert done.returncode == 2
    said = json.loads(done.stdout, parse_constant=pytest.fail)
    assert said["sound"] is False
    assert said["findings"] == []
    (problem,) = said["problems"]
    assert problem["where"] == "--set control.k1=nan"
    assert problem["remedy"] == "must be a finite number"
    done = fleetloop(tmp_path, "check", "nowhere.toml", "--json")
    assert "no such file" in json.loads(done.stdout)["problems"][0]["remedy"]
    listed = json.loads(fleetloop(tmp_path, "check", "--json").stdout)["shipped"]
    assert [one["name"] for one in listed] == list(shipped())


def test_what_runs_on_its_own_refuses_another_clock(tmp_path: Path) -> None:
    for verb in (["plant", "two_robots"], ["agent", "two_robots", "r1", "--deployment=x"]):
        done = fleetloop(tmp_path, *verb, "--clock", "lockstep")
        assert done.returncode == 2
        assert done.stderr.startswith("fleetloop: --clock lockstep: ")


def test_check_without_a_name_lists_the_shipped_scenarios(tmp_path: Path) -> None:
    out = fleetloop(tmp_path, "check").stdout
    for name in shipped():
        assert name in out


def test_check_gives_alike_robots_one_line(tmp_path: Path) -> None:
    lines = fleetloop(tmp_path, "check", "twelve").stdout.splitlines()
    for title in ("sampled speed loop", "first torques", "bus at 1000 kbit/s"):
        assert sum(title in line for line in lines) == 1


def test_check_shows_both_sides_of_46(tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "check", "paper_ring")
    assert done.returncode == 0
    assert "p²/q > max Im(ζ)²/Re(ζ)" in done.stdout
    assert re.search(r"4 +> 1 ", done.stdout)
    assert "sound" in done.stdout


def test_check_of_an_unsound_scenario_ends_with_1(tmp_path: Path) -> None:
    done = program("check", "paper", "--set", "control.k4=30.0", "--json", cwd=tmp_path)
    assert done.returncode == 1
    assert json.loads(done.stdout)["sound"] is False


def test_run_refuses_what_check_calls_an_error_unless_it_is_forced(tmp_path: Path) -> None:
    stiff = "--in-process", "--no-report", "--json", "--set", "control.k4=30.0"
    refused = fleetloop(tmp_path, "run", "two_robots", *stiff)
    outcome = json.loads(refused.stdout)
    assert (refused.returncode, outcome["exit_status"]) == (2, 2)
    assert outcome["verdict"] == "refused"
    assert "error: r1, r2: sampled speed loop" in refused.stderr
    assert "would not work as it is, by r1, r2: sampled speed loop" in outcome["reason"]
    assert "--force runs it" in outcome["problems"][0]["remedy"]
    assert list(tmp_path.iterdir()) == []
    forced = fleetloop(tmp_path, "run", "two_robots", *stiff, "--force", "--duration", "0.5")
    assert json.loads(forced.stdout)["verdict"] == "failed"
    assert "error: r1, r2: sampled speed loop" in forced.stderr


def test_a_path_that_stands_still_is_refused_by_check_and_run(tmp_path: Path) -> None:
    centre = "--set", "robot.r1.offset={kind='structure', left_m=3.0}"
    for verb in ("check", "run"):
        done = fleetloop(tmp_path, verb, "two_robots", *centre)
        assert done.returncode == 2
        assert "robot.r1.offset.left_m = 3.0: r1's path stands still" in done.stderr


def test_init_writes_a_scenario_that_checks_and_is_not_overwritten(tmp_path: Path) -> None:
    assert fleetloop(tmp_path, "init", "mine.toml").returncode == 0
    assert load(tmp_path / "mine.toml").name == "my_scenario"
    assert fleetloop(tmp_path, "check", "mine.toml").returncode == 0
    again = fleetloop(tmp_path, "init", "mine.toml")
    assert again.returncode == 2
    assert "exists already" in again.stderr


def test_a_bad_scenario_ends_with_2_one_line_per_problem_and_starts_nothing(tmp_path: Path) -> None:
    done = program(
        "run", "two_robots", "--set", "control.k1=-1", "--set", "nonsense=1", cwd=tmp_path
    )
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert len(lines) == 2
    assert "--set control.k1=-1: must be greater than 0" in done.stderr
    assert "--set nonsense=1: unknown key" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_expectation_of_an_unknown_signal_ends_with_2(tmp_path: Path) -> None:
    bad = 'expect=[{signal="speed", max=1.0}]'
    done = fleetloop(tmp_path, "run", "two_robots", "--set", bad)
    assert done.returncode == 2
    assert "no such signal" in done.stderr


def test_an_expectation_that_fails_ends_with_1(tmp_path: Path) -> None:
    done = fleetloop(
        tmp_path,
        "run",
        "two_robots",
        "--in-process",
        "--no-report",
        "--duration=0.1",
        "--set",
        'expect=[{signal="v_m_s", max=0.1}]',
    )
    assert done.returncode == 1
    assert "FAILED" in done.stdout


IN_PROCESS = ("--in-process", "--no-report", "--out=x")
ENDS_BEFORE = "--duration=0.5"


@pytest.mark.parametrize(
    ("args", "status", "verdict"),
    [
        ((), 0, "held"),
        ((ENDS_BEFORE,), 1, "not checked"),
        ((ENDS_BEFORE, "--allow-unchecked"), 0, "not checked"),
        (("--duration=0.1", "--set=expect=[]"), 0, "not checked"),
    ],
    ids=["whole", "too short", "allowed", "nothing expected"],
)
def test_what_was_not_reached_is_not_held(
    args: tuple[str, ...], status: int, verdict: str, tmp_path: Path
) -> None:
    done = fleetloop(tmp_path, "run", "two_robots", *IN_PROCESS, *args)
    assert done.returncode == status, done.stdout + done.stderr
    assert f"verdict  {verdict}" in done.stdout
    assert json.loads((tmp_path / "x" / "summary.json").read_text())["verdict"] == verdict
    if ENDS_BEFORE in args:
        assert "not reached" in done.stdout
        # Said before anything runs, and again by a run of the scenario that it left.
        assert "the run ends at 0.5 s" in done.stderr
        again = fleetloop(tmp_path, "run", "x/scenario.toml", *IN_PROCESS[:2], "--out=y")
        assert (again.returncode, "verdict  not checked" in again.stdout) == (1, True)


def test_a_folder_in_use_and_a_folder_that_can_not_be_made_are_named(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    done = fleetloop(tmp_path, "run", "two_robots", "--out", "full")
    assert (done.returncode, "not an empty folder" in done.stderr) == (2, True)
    done = fleetloop(tmp_path, "run", "two_robots", "--out", "full/file/x")
    assert (done.returncode, "can't write the run's folder" in done.stderr) == (3, True)


def test_json_of_a_run_is_its_summary_and_nothing_else(tmp_path: Path) -> None:
    done = program(
        "run",
        "two_robots",
        "--in-process",
        "--json",
        "--no-report",
        "--duration=0.5",
        "--allow-unchecked",
        "--out=x",
        cwd=tmp_path,
    )
    assert done.returncode == 0
    summary = json.loads(done.stdout)
    assert summary["ticks"] == 250
    assert json.loads((tmp_path / "x" / "summary.json").read_text()).items() <= summary.items()


def test_real_time_needs_processes(tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "run", "realtime_100hz", "--in-process")
    assert done.returncode == 2
    assert "--clock lockstep" in done.stderr
    done = fleetloop(tmp_path, "run", "realtime_100hz", "--speed", "2")
    assert (done.returncode, "real time has one speed" in done.stderr) == (2, True)
    done = fleetloop(tmp_path, "run", "two_robots", "--clock", "sundial")
    assert done.returncode == 2
    assert done.stderr == "fleetloop: --clock sundial: must be 'lockstep' or 'realtime'\n"


def test_reports_of_nothing_end_with_2(tmp_path: Path) -> None:
    for verb in (["report", "nowhere"], ["export", "nowhere", "a.csv"], ["diff", "a", "b"]):
        done = fleetloop(tmp_path, *verb)
        assert done.returncode == 2
        assert "no record.mcap there" in done.stderr


def test_a_role_is_not_started_by_hand(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "agents"], input=b"", capture_output=True, timeout=30, cwd=tmp_path
    )
    assert done.returncode == 2
    assert b"no AgentBrief" in done.stderr


@pytest.mark.parametrize(
    "args",
    [
        ("plant", "two_robots", "--robots", ""),
        ("export", "run", "out.csv", "--robots", ","),
        ("export", "run", "out.csv", "--signals", " "),
    ],
)
def test_an_option_that_names_nothing_is_not_taken_for_all(args: tuple[str, ...]) -> None:
    from typer.testing import CliRunner

    from fleetloop.cli import app

    done = CliRunner().invoke(app, args)
    assert isinstance(done.exception, ScenarioError)
    assert str(done.exception).startswith(f"{args[-2]} {args[-1]!r}: names nothing")


@pytest.mark.parametrize("value", ["nan", "inf", "-1", "1e308", "ten", ""])
@pytest.mark.parametrize(
    ("args", "option"),
    [
        (("plant", "two_robots"), "--duration"),
        (("run", "two_robots"), "--duration"),
        (("run", "two_robots"), "--speed"),
        (("can", "list"), "--seconds"),
        (("can", "dump", "any"), "-T"),
        (("can", "send", "r1", "017#"), "-g"),
    ],
)
def test_a_number_that_is_none_is_blamed_on_its_option(
    value: str, args: tuple[str, ...], option: str
) -> None:
    from typer.testing import CliRunner

    from fleetloop.cli import app

    done = CliRunner().invoke(app, [*args, option, value])
    said = f"{done.stderr} {done.exception}"
    assert option in said
    assert "must be" in said
    assert "Input" not in said
    assert done.exit_code == 2 or isinstance(done.exception, ScenarioError)
