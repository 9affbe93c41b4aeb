"""Expectations while a run goes on: open until their window is reached, then as the report says."""

from collections.abc import Sequence

import numpy as np
import pytest
from support.in_process import RanInProcess

from configs.loading import load
from configs.resolve import signals_of
from configs.scenario import Scenario
from configs.signals import PLANT_SIGNALS, Signal
from fleetloop.live.expected import LiveExpectations

EXPECT = (
    "expect=[{signal='x_e_m', max_abs=1000.0, to_s=1.0}, {signal='s', min=1e6, to_s=1.0},"
    "{signal='y_e_m', max_abs=1000.0, from_s=2.0}, {event='stopped', at_most=0},"
    "{signal='robot_distance_m', min=0.0, to_s=1.0}]"
)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load("two_robots", ("duration_s=3.0", EXPECT))


@pytest.fixture(scope="module")
def ran(scenario: Scenario) -> RanInProcess:
    return RanInProcess(scenario)


def tables(scenario: Scenario) -> dict[str, Sequence[Signal]]:
    return {robot.name: signals_of(scenario, robot) for robot in scenario.robot}


def fed(scenario: Scenario, ran: RanInProcess, first: int, upto: int) -> LiveExpectations:
    live = LiveExpectations(scenario, tables(scenario))
    for robot, table in tables(scenario).items():
        for source, width in (("plant", len(PLANT_SIGNALS)), ("controller", len(table))):
            rows = np.frombuffer(ran.rows[robot, source]).reshape(-1, width)
            live.add(robot, source, first, rows[first:upto])
    return live


def held(live: LiveExpectations) -> list[bool | None]:
    return [one["held"] for one in live.judged]


def test_all_are_open_before_a_row_comes(scenario: Scenario) -> None:
    live = LiveExpectations(scenario, tables(scenario))
    live.judge([])
    assert held(live) == [None] * 5
    assert live.judged[0]["claim"].startswith("x_e_m within ±1000")


def test_a_broken_bound_fails_at_once_others_wait_for_their_window(
    scenario: Scenario, ran: RanInProcess
) -> None:
    live = fed(scenario, ran, 0, 250)
    live.judge([])
    assert held(live) == [None, False, None, None, None]


def test_on_all_rows_they_are_the_results(scenario: Scenario, ran: RanInProcess) -> None:
    live = fed(scenario, ran, 0, 10**6)
    live.judge([])
    assert held(live) == [True, False, True, True, True]
    live.judge([ran.events[0]._replace(tick=5, kind="stopped")])
    assert held(live)[3] is False, "counts are of all events that are known"


def test_counts_of_events_stay_open_while_events_are_not_known(
    scenario: Scenario, ran: RanInProcess
) -> None:
    live = fed(scenario, ran, 0, 10**6)
    live.judge(None)
    assert held(live)[3] is None


def test_what_was_not_heard_from_its_beginning_stays_open(
    scenario: Scenario, ran: RanInProcess
) -> None:
    live = fed(scenario, ran, 100, 10**6)
    live.judge([])
    assert held(live) == [None, None, True, None, None]


def test_a_run_too_long_to_be_kept_is_not_judged(
    scenario: Scenario, ran: RanInProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fleetloop.live.expected.MOST_BYTES", 1000)
    live = fed(scenario, ran, 0, 10**6)
    assert not live.judge([])
    assert held(live) == [None] * 5
