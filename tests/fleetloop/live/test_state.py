"""The picture of a run: the values of its record, in frames that a browser can put together."""

import json

import numpy as np
import pytest
from support.in_process import RanInProcess

from bridge.network.telemetry import PLANT_ROW, row_of
from configs.loading import load
from configs.resolve import signals_of
from configs.scenario import Scenario
from fleetloop.live.frame import HEAD, Cursor, legend
from fleetloop.live.series import CAPACITY
from fleetloop.live.state import NOW, SERIES, LiveState

BLOCK = 128


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load("two_robots", ("duration_s=3.0", "expect=[]"))


@pytest.fixture(scope="module")
def ran(scenario: Scenario) -> RanInProcess:
    return RanInProcess(scenario)


def sizes(scenario: Scenario) -> dict[tuple[str, str], int]:
    controllers = {
        (robot.name, "controller"): row_of(signals_of(scenario, robot)).size
        for robot in scenario.robot
    }
    return controllers | {(robot.name, "plant"): PLANT_ROW.size for robot in scenario.robot}


def tell(state: LiveState, ran: RanInProcess, first: int, upto: int) -> None:
    for (robot, source), size in sizes(state.scenario).items():
        block = ran.rows[robot, source][first * size : upto * size]
        state.hear(robot, source, first, block)


def told(scenario: Scenario, ran: RanInProcess) -> LiveState:
    state = LiveState(scenario)
    for first in range(0, state.schedule.ticks, BLOCK):
        tell(state, ran, first, first + BLOCK)
        state.settle()
    return state


class Browser:
    """What the page's script does with frames."""

    def __init__(self, state: LiveState) -> None:
        self.legend = json.loads(json.dumps(legend(state)))
        self.rows = np.empty((0, 1 + len(self.legend["charted"]) * len(self.legend["series"])))

    def take(self, frame: np.ndarray) -> None:
        robots, edges = len(self.legend["robots"]), len(self.legend["edges"])
        self.head = dict(zip(self.legend["head"], frame, strict=False))
        at = len(self.legend["head"])
        self.now = frame[at : at + robots * len(NOW)].reshape(robots, -1)
        at += robots * len(NOW) + 3 * edges
        rows = frame[at:].reshape(-1, self.rows.shape[1])
        assert len(rows) == self.head["rows"]
        self.rows = rows if self.head["whole"] else np.concatenate([self.rows, rows])


def test_the_newest_values_are_the_last_of_the_record(
    scenario: Scenario, ran: RanInProcess
) -> None:
    state = told(scenario, ran)
    now = dict(zip(NOW, state.now()[1], strict=True))
    assert now["x"] == ran.truth("r2")["x_m"][-1]
    assert now["y_e"] == ran.controller("r2")["y_e_m"][-1]
    assert now["tau_left"] == ran.controller("r2")["tau_left_wheel_N_m"][-1]
    assert state.tick == state.schedule.ticks - 1


def test_a_browser_has_the_series_of_the_record_with_every_peak(
    scenario: Scenario, ran: RanInProcess
) -> None:
    state, cursor = LiveState(scenario), Cursor()
    browser = Browser(state)
    for first in range(0, state.schedule.ticks, BLOCK):
        tell(state, ran, first, first + BLOCK)
        state.settle()
        browser.take(cursor.frame(state))
    t, stride = browser.rows[:, 0], state.stride
    assert len(t) == state.schedule.ticks // stride
    assert np.allclose(np.diff(t), stride * state.schedule.period_s)
    column = 1 + [one.name for one in SERIES].index("tau_right")
    torques = ran.controller("r1")["tau_right_wheel_N_m"]
    assert np.abs(browser.rows[:, column]).max() == max(map(abs, torques))


def test_a_browser_that_missed_frames_has_the_same_afterwards(
    scenario: Scenario, ran: RanInProcess
) -> None:
    whole, skipped = Browser(LiveState(scenario)), Browser(LiveState(scenario))
    state, one, other = LiveState(scenario), Cursor(), Cursor()
    for number, first in enumerate(range(0, state.schedule.ticks, BLOCK)):
        tell(state, ran, first, first + BLOCK)
        state.settle()
        whole.take(one.frame(state))
        if number % 4 == 0:
            skipped.take(other.frame(state))
    skipped.take(other.frame(state))
    assert np.array_equal(whole.rows, skipped.rows, equal_nan=True)


def test_a_browsers_part_is_replaced_before_it_gets_large(
    scenario: Scenario, ran: RanInProcess
) -> None:
    state, cursor = told(scenario, ran), Cursor()
    browser, replaced = Browser(state), 0
    width = 1 + len(SERIES) * len(state.charted)
    for first in range(state.history.end, state.history.end + 4 * CAPACITY, 50):
        state.history.append(first, np.zeros((50, width)))
        browser.take(cursor.frame(state))
        replaced += int(browser.head["whole"])
        assert len(browser.rows) <= 2 * CAPACITY
    assert 2 <= replaced <= 6


def test_nothing_is_decoded_before_somebody_looks_and_what_waits_is_bounded(
    scenario: Scenario, ran: RanInProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fleetloop.live.state.MOST_WAITING_BYTES", 100_000)
    state = LiveState(scenario)
    for first in range(0, state.schedule.ticks, BLOCK):
        tell(state, ran, first, first + BLOCK)
    assert state.tick == -1
    assert state.passed_over > 0
    state.settle()
    assert 0 < state.tick < state.schedule.ticks


def test_a_robot_without_rows_holds_up_no_other(scenario: Scenario, ran: RanInProcess) -> None:
    state = LiveState(scenario)
    for first in range(0, state.schedule.ticks, BLOCK):
        for (robot, source), size in sizes(scenario).items():
            if robot == "r1" or first < 2 * BLOCK:
                block = ran.rows[robot, source][first * size : (first + BLOCK) * size]
                state.hear(robot, source, first, block)
        state.settle()
    rows = state.history.since(0)
    assert len(rows) == state.schedule.ticks // state.stride
    assert np.isnan(rows[-1, 1 + len(SERIES) :]).all()
    assert np.isfinite(rows[:, 1 : 1 + len(SERIES)]).all()


def test_a_page_that_comes_later_has_what_it_heard(scenario: Scenario, ran: RanInProcess) -> None:
    state, begins = LiveState(scenario), 4 * BLOCK
    for first in range(begins, state.schedule.ticks, BLOCK):
        tell(state, ran, first, first + BLOCK)
        state.settle()
    rows = state.history.since(0)
    assert rows[0, 0] >= begins * state.schedule.period_s
    assert np.isfinite(rows[1:]).all()


def test_the_legend_names_what_a_frame_has(scenario: Scenario) -> None:
    state = LiveState(scenario)
    said = legend(state)
    assert said["head"] == list(HEAD)
    assert said["edges"] == [["r1", "r2"]]
    assert len(Cursor().frame(state)) == len(HEAD) + 2 * len(NOW) + 3
