"""Cells, the windows of their expectations, refusals, and the command that runs one again."""

import itertools
import shlex
from dataclasses import replace

import pytest

from configs.errors import ScenarioError
from configs.faults.kinds import KINDS
from configs.loading import load
from fleetloop.campaign.matrix import Cell, Conditions, cells_of, command, kinds_of, under, windows

CONDITIONS = Conditions(("r1",), 2.0, 5.0, 1.0)


def fault(kind: str, at_s: float, scenario: str = "two_robots"):
    found = kinds_of(load(scenario), [kind], at_s, CONDITIONS, folder="")
    assert not found.refused
    return found.faults[kind]


def test_cells_are_every_kind_at_every_time_with_every_seed() -> None:
    cells = list(cells_of(["push", "bus_cut"], [5.0, 10.0], [1, 2]))
    assert len(cells) == len(set(cells)) == 8
    assert cells[0] == Cell("push", 5.0, 1)
    assert cells[-1] == Cell("bus_cut", 10.0, 2)


@pytest.mark.parametrize(
    ("at_s", "kept_s", "strict_s", "late_s", "ends_s"),
    [
        (10.0, 3.0, 10.0, 17.0, 18.0),  # from the fault on; 5 s after its end
        (1.0, 4.0, 4.0, 9.0, 10.0),  # from where it is kept on; 5 s later
        (2.5, 4.0, 4.0, 9.5, 10.5),  # the fault ends last
    ],
)
def test_a_bound_is_asked_for_from_the_fault_and_again_after_it(
    at_s: float, kept_s: float, strict_s: float, late_s: float, ends_s: float
) -> None:
    scenario = load("paper")
    found = windows(scenario, [kept_s] * 4, fault("push", at_s, "paper"), CONDITIONS)
    assert [one.from_s for one in found.strict] == [strict_s] * 4
    assert [one.from_s for one in found.late] == [late_s] * 4
    assert found.ends_at_s == ends_s


def test_an_instant_is_over_at_once() -> None:
    scenario = load("paper")
    found = windows(scenario, [3.0] * 4, fault("drive_estop", 10.0, "paper"), CONDITIONS)
    assert {one.from_s for one in found.late} == {15.0}


def test_a_window_with_an_end_of_its_own_stays_and_is_reached() -> None:
    scenario = load("two_robots", ("expect.0.to_s=3.9",))
    conditions = replace(CONDITIONS, for_s=0.1, recover_s=0.1, hold_s=0.1)
    found = windows(scenario, [1.0, 1.0], replace(fault("push", 2.0), for_s=0.1), conditions)
    assert found.strict[0] == found.late[0] == scenario.expect[0]
    assert found.ends_at_s == 3.902  # its last tick is at 3.9 s


def test_events_and_what_holds_eventually_keep_their_windows() -> None:
    own = (
        'expect=[{event="stopped", at_most=0}, {signal="s", min=1.0, holds="eventually"},'
        ' {event="stopped", at_least=1, to_s=3.0}, {signal="s", max=9.0, after="own"}]'
    )
    fault_of_its_own = 'fault=[{kind="push", name="own", at_s=1.0, for_s=0.1}]'
    scenario = load("two_robots", (own, fault_of_its_own))
    found = windows(scenario, [0.0] * 4, fault("push", 0.5), replace(CONDITIONS, recover_s=0.0))
    assert found.strict == found.late == scenario.expect
    assert found.ends_at_s == 4.0  # that of the scenario: until then it can come


def test_a_link_fault_is_of_all_edges_of_the_robots_and_of_no_others() -> None:
    scenario = load("paper")
    table = replace(CONDITIONS, robots=("r2",)).table("link_delay", 5.0, scenario)
    assert table["edges"] == ["r1 -> r2", "r2 -> r3"]
    assert "robots" not in table


def test_kinds_that_cant_act_are_refused_with_the_reason_others_are_there() -> None:
    found = kinds_of(load("paper"), list(KINDS), 5.0, CONDITIONS, folder="")
    assert {*found.faults} | {*found.refused} == {*KINDS}
    assert "needs drive.preset = 'realistic'" in found.refused["under_voltage"]
    assert "needs bus.timing = 'wire'" in found.refused["can_corrupt"]


def test_a_parameter_that_is_wrong_is_an_error_and_no_refusal() -> None:
    given = replace(CONDITIONS, parameters={"torque_half": {"wheel": "lft"}})
    with pytest.raises(ScenarioError, match=r"--faults torque_half: fault\.0.*wheel"):
        kinds_of(load("paper"), ["torque_half"], 5.0, given, folder="")


def test_the_command_makes_the_same_scenario_again() -> None:
    scenario = load("two_robots", ("coordination.p=3",))
    pushed = fault("push", 2.0)
    asked = windows(scenario, [1.0, 1.0], pushed, CONDITIONS)
    made = under(scenario, pushed, 7, asked)
    text = command("two_robots", ("coordination.p=3",), made, in_process=True)
    words = shlex.split(text)
    assert words[:4] == ["fleetloop", "run", "two_robots", "--in-process"]
    sets = [value for word, value in itertools.pairwise(words) if word == "--set"]
    seed, until = words[words.index("--seed") + 1], words[words.index("--duration") + 1]
    again = load("two_robots", (*sets, f"seed={seed}", f"until_s={float(until)}"))
    assert again == made
