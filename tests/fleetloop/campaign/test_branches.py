"""Branches of a run: bit for bit the run with the fault in its file."""

import hashlib
import os
from dataclasses import replace

import pytest

from bridge.process.lifecycle import Stop
from configs.connections import NetworkLink
from configs.loading import load, loads, to_toml
from configs.resolve import agent_brief, leader_brief, plant_brief, signals_of
from configs.scenario import Scenario
from fleetloop.campaign.branches import Planned, Trunk, groups_of
from fleetloop.campaign.forks import Children
from fleetloop.campaign.matrix import Cell, Conditions, kinds_of
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.in_process.run import InProcessRun
from fleetloop.record.memory import MemoryRecord
from fleetloop.record.reader import Record

NETWORK = NetworkLink("in-process", "", "", "")
CONDITIONS = Conditions(("r1",), 0.1, 0.1, 0.1)
KEPT_S = (0.0, 0.0)


def planned(kind: str, at_s: float, scenario: Scenario) -> Planned:
    fault = kinds_of(scenario, [kind], at_s, CONDITIONS, folder="").faults[kind]
    return Planned.of(scenario, Cell(kind, at_s, scenario.seed), fault, KEPT_S, CONDITIONS)


def digest(record: Record) -> str:
    found = hashlib.sha256()
    for rows in (*record.plant.values(), *record.controller.values()):
        found.update(str(rows.dtype).encode() + rows.tobytes())
    return found.hexdigest()


def whole(scenario: Scenario) -> str:
    """The rows of the run of a scenario that was written to a file and loaded again."""
    scenario = loads("again", to_toml(scenario))
    memory = MemoryRecord()
    run = InProcessRun(
        plant_brief(scenario, network=NETWORK),
        [agent_brief(scenario, name, network=NETWORK, bus=()) for name in scenario.names],
        leader_brief(scenario),
        memory,
        lambda _: None,
    )
    run.run(Stop())
    signals = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
    return digest(memory.record(signals, ""))


@pytest.mark.parametrize(
    "kinds",
    [
        ("push", "torque_half", "encoder_noise", "localisation_bias", "can_drop", "drive_estop"),
        ("localisation_outage",),
        ("link_loss", "link_delay"),
    ],
)
def test_a_branch_leaves_the_rows_of_a_whole_run_with_the_fault(kinds: tuple[str, ...]) -> None:
    scenario = load("two_robots", ("host.rearm=true",))  # so that no stop ends a cell
    cells = [planned(kind, at_s, scenario) for kind in kinds for at_s in (0.2, 0.3)]
    (group,) = groups_of(cells)
    told: dict[str, str] = {}
    trunk = Trunk(group, lambda _: None)
    children = Children(lambda said: told.update(key(said)))

    def key(said: object) -> dict[str, str]:
        if not isinstance(said, Result):
            return {}
        return {f"{said.cell.kind} {said.cell.at_s}": said.reason}

    trunk.run.begin()
    for tick, at_tick in group.by_tick():
        trunk.run.go(tick, Stop())
        for one in at_tick:

            def body(one: Planned = one) -> Result:
                return Result(one.cell, Verdict.HELD, digest(trunk.outcome(one).record))

            children.start(one.cell, body, 60.0)
    children.gather(Stop(), most=0)
    assert told == {f"{one.cell.kind} {one.cell.at_s}": whole(one.scenario) for one in cells}


def test_cells_branch_from_the_same_run_only_if_nothing_else_differs() -> None:
    scenario = load("two_robots")
    kinds = ("push", "link_loss", "localisation_outage", "link_partition")
    groups = groups_of([planned(kind, 0.2, scenario) for kind in kinds])
    assert [[one.cell.kind for one in group.cells] for group in groups] == [
        ["push"],
        ["link_loss", "link_partition"],
        ["localisation_outage"],
    ]


def brought(body, limit_s: float = 60.0) -> Result:
    told: list[object] = []
    children = Children(told.append)
    children.start(Cell("push", 1.0, 1), body, limit_s)
    children.gather(Stop(), most=0)
    (result,) = [one for one in told if isinstance(one, Result)]
    return result


def test_a_child_that_raises_dies_or_takes_too_long_is_a_result() -> None:
    assert brought(lambda: 1 / 0).reason == "a bug: ZeroDivisionError: division by zero"
    assert brought(lambda: os._exit(7)).reason == "its process ended early (exit status 7)"

    def forever() -> None:
        while True:
            pass

    late = brought(forever, 0.2)
    assert (late.verdict, late.reason) == (Verdict.ERROR, "took longer than its limit (--limit)")


def test_a_stop_ends_the_children() -> None:
    stop = Stop()
    children = Children(lambda _: stop.request("interrupted"))

    def forever() -> Result:
        while True:
            pass

    children.start(Cell("push", 1.0, 1), forever, 60.0)
    children.gather(stop, most=0)
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_a_fault_is_taken_beside_those_of_the_scenario() -> None:
    own = 'fault=[{kind="push", at_s=0.1, for_s=0.3, robots=["r2"]}]'
    scenario = load("two_robots", (own,))
    one = planned("push", 0.2, scenario)
    assert one.name == "push_2"
    trunk = Trunk(*groups_of([one]), lambda _: None)
    trunk.run.begin()
    trunk.run.go(one.from_tick, Stop())
    assert digest(trunk.outcome(one).record) == whole(one.scenario)
    assert whole(replace_faults(one.scenario)) != whole(one.scenario)


def replace_faults(scenario: Scenario) -> Scenario:
    weaker = replace(scenario.fault[-1], force_body_N=1.0)
    return scenario.model_copy(update={"fault": (scenario.fault[0], weaker)})
