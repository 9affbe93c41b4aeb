"""`fleetloop fault kinds`: the table of kinds from their classes; verbs with and without a run."""

import json
from pathlib import Path

import pytest
from support.command_line import fleetloop

from configs.faults.kinds import GROUPS, KINDS


def test_every_kind_is_listed_with_its_parameters(tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "fault", "kinds", "--json")
    assert done.returncode == 0
    listed = {one["kind"]: one for one in json.loads(done.stdout)}
    assert list(listed) == list(KINDS)
    push = {one["key"]: one for one in listed["push"]["parameters"]}
    assert list(push) == ["robots", "force_body_N", "torque_body_N_m"]
    assert push["force_body_N"]["default"] == 5.0
    assert push["force_body_N"]["values"].startswith("number, ≥ -1e+12")
    assert listed["can_corrupt"]["needs"] == ["bus.timing = 'wire'"]
    assert (listed["under_voltage"]["group"], listed["push"]["group"]) == (
        *("supply", "bodies and ground"),
    )
    text = fleetloop(tmp_path, "fault", "kinds").stdout
    lines = [line.split("  ")[0].strip() or line.split()[0] for line in text.splitlines()[1:]]
    assert [line for line in lines if line in KINDS] == [*KINDS]
    assert [line for line in lines if line not in KINDS] == [*GROUPS]


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("link_loss", "number, ≥ 0, ≤ 1"),
        ("can_delay", "to_drives or from_drives or both"),
        ("can_drop", "whole number, ≥ 0, ≤ 536870911"),
        ("node_bus_off", "at an instant: no for_s; needs bus.timing = 'wire'"),
        ("torque_half", "for_s seconds, or to the end"),
        ("link_delay", "list of texts"),
    ],
)
def test_one_kind_is_told_with_bounds_and_defaults(kind: str, said: str, tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "fault", "kinds", kind)
    assert done.returncode == 0
    assert said in done.stdout


def test_a_kind_that_is_none_is_told_with_the_nearest(tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "fault", "kinds", "pusch")
    assert done.returncode == 2
    assert "pusch: no such kind; did you mean push?" in done.stderr


@pytest.mark.parametrize("words", [("list",), ("nope", "list"), ("inject", "push"), ("clear", "a")])
def test_without_a_run_each_verb_says_so(words: tuple[str, ...], tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "fault", *words)
    assert done.returncode == 2
    assert "no run goes on on this machine" in done.stderr


def test_clear_wants_names_or_all_and_a_parameter_a_value(tmp_path: Path) -> None:
    assert fleetloop(tmp_path, "fault", "clear").returncode == 2
    assert fleetloop(tmp_path, "fault", "clear", "a", "--all").returncode == 2
    done = fleetloop(tmp_path, "fault", "inject", "push", "--set", "force_body_N")
    assert done.returncode == 2
    assert "must read key=value" in done.stderr
