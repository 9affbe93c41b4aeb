"""Options of a campaign, read."""

import json

import pytest
import typer

from configs.errors import ScenarioError
from configs.faults.kinds import KINDS
from configs.loading import load
from fleetloop.campaign import plan
from fleetloop.campaign.matrix import Conditions


def test_times_are_a_range_with_both_ends_or_a_list() -> None:
    paper = load("paper")
    assert plan.times_named("5:25:5", paper) == (5.0, 10.0, 15.0, 20.0, 25.0)
    assert plan.times_named("0.1:0.5:0.1", paper) == (0.1, 0.2, 0.3, 0.4, 0.5)
    assert plan.times_named("5,10.5,5", paper) == (5.0, 10.5)


@pytest.mark.parametrize("text", ["", "x", "5:1:1", "1:5", "1:5:0", "1:2:nan", "0:1:1e-9"])
def test_what_are_no_times_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="FROM:TO:STEP"):
        plan.times_named(text, load("paper"))


def test_a_time_after_the_end_is_refused() -> None:
    with pytest.raises(typer.BadParameter, match="30 s"):
        plan.times_named("5,30", load("paper"))


def test_a_number_of_seeds_counts_from_the_scenarios_on_and_a_list_is_itself() -> None:
    assert plan.seeds_named("3", 4) == (4, 5, 6)
    assert plan.seeds_named("7,9", 4) == (7, 9)
    assert plan.seeds_named(None, 4) == (4,)
    with pytest.raises(typer.BadParameter):
        plan.seeds_named("0", 4)


def test_kinds_are_all_or_named_ones() -> None:
    assert plan.kinds_named("all") == tuple(KINDS)
    assert plan.kinds_named("push, bus_cut,push") == ("push", "bus_cut")
    with pytest.raises(ScenarioError, match="did you mean push"):
        plan.kinds_named("psuh")


def test_parameters_name_a_kind_of_the_campaign() -> None:
    found = plan.parameters_named(["push.force_body_N=20", "torque_half.wheel=left"], [*KINDS])
    assert found == {"push": {"force_body_N": 20}, "torque_half": {"wheel": "left"}}
    for text in ("push", "push.force", "bus_cut.for_s=1", "push.at_s=3"):
        with pytest.raises(ScenarioError, match="--param"):
            plan.parameters_named([text], ["push"])


def test_a_plan_comes_back_from_its_file() -> None:
    shared = Conditions(("r1",), 2.0, 5.0, 1.0, {"push": {"force_body_N": 20.0}})
    made = plan.Plan("paper", ("seed=3",), ("push",), (5.0,), (1, 2), shared, True, 300.0)
    assert plan.Plan.from_table(json.loads(json.dumps(made.as_table()))) == made
