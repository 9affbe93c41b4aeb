"""Faults that are ordered during a run: the same checks as of a file, in terms of the order."""

import pytest

from configs.errors import ScenarioError
from configs.faults.ordered import ordered_fault
from configs.faults.plan import fresh_name
from configs.loading import load

SCENARIO = load("two_robots", ("duration_s=20.0",))


def refused(**table) -> str:
    with pytest.raises(ScenarioError) as error:
        ordered_fault(table, SCENARIO, 4.0, ("shove",))
    return str(error.value)


def test_without_a_time_it_begins_now() -> None:
    fault = ordered_fault({"kind": "push", "robots": ["r2"], "for_s": 1}, SCENARIO, 4.0, ())
    assert (fault.at_s, fault.for_s) == (4.0, 1.0)
    assert ordered_fault({"kind": "push", "at_s": 5.0}, SCENARIO, 4.0, ()).at_s == 5.0


def test_all_that_is_wrong_is_said_with_key_value_and_remedy() -> None:
    said = refused(kind="push", robots=["r9"], name="shove", at_s=1.0)
    assert 'fault: robots = "r9": no such robot' in said
    assert 'fault: name = "shove": another fault of this run has this name' in said
    assert "fault: at_s = 1.0: has gone: the run is at 4.000 s" in said


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"kind": "pusch"}, "did you mean push?"),
        ({}, "fault: kind = null: must be one of"),
        ({"kind": "push", "force": 3.0}, "fault: force = 3.0: unknown key"),
        ({"kind": "push", "force_body_N": "4"}, 'force_body_N = "4": must be a number'),
        ({"kind": "link_loss", "probability": 2.0}, "probability = 2.0: must be 1 or less"),
        ({"kind": "drive_estop", "for_s": 1.0}, "happens at an instant"),
        ({"kind": "link_delay", "edges": ["r2 -> r1"]}, "no such edge in the graph"),
        ({"kind": "can_corrupt"}, "needs bus.timing = 'wire'"),
        ({"kind": "push", "at_s": 1e6}, "the run ends before"),
    ],
)
def test_what_the_scenario_would_refuse_is_refused(table: dict, said: str) -> None:
    assert said in refused(**table)


def test_a_name_is_found_for_a_fault_without_one() -> None:
    assert fresh_name("push", ()) == "push"
    assert fresh_name("push", ("push", "push_2")) == "push_3"
