"""JUnit reports: valid by the rules of Jenkins' plug-in, and each verdict where CI looks for it."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.junit import valid

from configs.errors import InfrastructureError, ScenarioError
from configs.loading import load
from fleetloop.record.reader import Record
from fleetloop.results.junit import write_junit
from fleetloop.results.outcome import Outcome, of_error, of_summary, unbegun
from fleetloop.results.summary import RunStats, summarise

EXPECT = (
    "expect=[{signal='v_m_s', max=0.1, name='slow'}, {signal='v_m_s', max=1e3}]",
    "until_s=4.0",
)


def outcome_of(run: Path, *overrides: str, status: int = 1, **stats: Any) -> Outcome:
    scenario = load("two_robots", (*EXPECT, *overrides))
    record = Record.open(run / "record.mcap")
    return of_summary(summarise(record, scenario, RunStats("lockstep", **stats)), run, status)


def cases(path: Path) -> dict[str, str | None]:
    """Every case, and what it says besides success."""
    root = valid(path.read_bytes())
    return {
        case.attrib["name"]: case[0].tag if len(case) else None for case in root.iter("testcase")
    }


def test_each_expectation_is_a_case_and_the_run_is_one(finished_run: Path, tmp_path: Path) -> None:
    path = tmp_path / "made" / "for" / "it.xml"
    write_junit(path, {"two_robots": outcome_of(finished_run)})
    assert cases(path) == {
        "run": None,
        "slow": "failure",
        "v_m_s within 1000 or less from 0 s": None,
    }
    root = valid(path.read_bytes())
    (failure,) = root.iter("failure")
    assert failure.text is not None
    assert failure.text.startswith("slow: v_m_s within 0.1 or less from 0 s: found ")
    assert ", margin -" in failure.text
    (suite,) = root
    assert (suite.attrib["name"], suite.attrib["skipped"]) == ("two_robots", "0")
    assert root[0][1].attrib["classname"] == "fleetloop.two_robots"


def test_cases_of_scenarios_with_one_name_differ_by_their_paths(
    finished_run: Path, tmp_path: Path
) -> None:
    outcome = outcome_of(finished_run, "expect=[{signal='x_e_m', max_abs=1e3}]")
    outcome["expectations"] *= 2
    write_junit(tmp_path / "a.xml", dict.fromkeys(("bench/a.toml", "bench/b.toml"), outcome))
    found = valid((tmp_path / "a.xml").read_bytes()).iter("testcase")
    names = [(it.attrib["classname"], it.attrib["name"]) for it in found]
    assert len(set(names)) == 6
    assert ("fleetloop.bench.b", "x_e_m within ±1000 from 0 s (2)") in names


def test_what_was_not_reached_is_an_error_unless_it_is_allowed(
    uneven_run: Path, tmp_path: Path
) -> None:
    outcome = outcome_of(uneven_run, "expect=[{signal='x_e_m', max_abs=1e3}]")
    name = "x_e_m within ±1000 from 0 s"
    write_junit(tmp_path / "a.xml", {"two_robots": outcome})
    assert cases(tmp_path / "a.xml") == {"run": "error", name: "error"}
    write_junit(tmp_path / "b.xml", {"two_robots": outcome}, allow_unchecked=True)
    assert cases(tmp_path / "b.xml")[name] == "skipped"


@pytest.mark.parametrize(
    ("outcome", "tag", "says"),
    [
        (of_error("a.toml", ScenarioError("a.toml: not a TOML file")), "error", "not a TOML file"),
        (of_error("a.toml", InfrastructureError("disk full")), "error", "disk full"),
        (unbegun("a", "interrupted", "interrupted by SIGINT", 130), "error", "by SIGINT"),
    ],
)
def test_a_run_that_did_not_end_is_an_error(
    outcome: Outcome, tag: str, says: str, tmp_path: Path
) -> None:
    write_junit(tmp_path / "a.xml", {"a.toml": outcome})
    assert cases(tmp_path / "a.xml") == {"run": tag}
    assert says in (tmp_path / "a.xml").read_text()


def test_a_robot_that_stopped_is_a_failure_of_the_run(finished_run: Path, tmp_path: Path) -> None:
    stopped = {"stopped_robots": {"r1": "tick 3 (t = 0.006 s): no pose"}}
    write_junit(tmp_path / "a.xml", {"two_robots": outcome_of(finished_run, **stopped)})
    assert cases(tmp_path / "a.xml")["run"] == "failure"
    assert "STOPPED r1: tick 3 (t = 0.006 s): no pose" in (tmp_path / "a.xml").read_text()


@given(st.text(max_size=30), st.text(max_size=30))
def test_any_text_makes_a_valid_report(name: str, reason: str) -> None:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.xml"
        write_junit(path, {name: unbegun(name, "aborted", reason, 3)})
        valid(path.read_bytes())


def test_every_outcome_has_the_same_keys_and_a_refusal_names_its_problems(
    finished_run: Path,
) -> None:
    with pytest.raises(ScenarioError) as refused:
        load("two_robots", ("seed=-1", "control.k1=-1.0"))
    outcome = of_error("two_robots", refused.value)
    assert (outcome["verdict"], outcome["exit_status"]) == ("refused", 2)
    problems = {problem["where"]: problem["value"] for problem in outcome["problems"]}
    assert problems == {"--set control.k1=-1.0": -1.0, "--set seed=-1": -1}
    assert set(outcome) <= set(outcome_of(finished_run))
    assert of_error("two_robots", InfrastructureError("gone"))["exit_status"] == 3
