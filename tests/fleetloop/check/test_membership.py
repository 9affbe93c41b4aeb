"""Theorem 3.1 for those that are there, and the forecast of a formation that changes."""

import numpy as np
import pytest

from agents.paths import robot_path
from configs.curves import reference_path
from configs.loading import load
from configs.paths import AT_CENTRE
from fleetloop.check.coordination import forecast
from fleetloop.check.emulated import emulated_forecast
from fleetloop.check.finding import Finding
from fleetloop.check.membership import membership_findings

SHORT = "duration_s=10.0", "expect=[]", "coordination.v_hat_0=0.6"
LINE = robot_path(reference_path(load("paper").path), AT_CENTRE)


def findings(*overrides: str) -> list[Finding]:
    return list(membership_findings(load("paper", overrides)))


def test_nothing_is_said_where_all_are_there_all_the_time() -> None:
    assert findings() == []


def test_a_leaf_may_come_and_go() -> None:
    (finding,) = findings("robot.r4.joins_at_s=3.0", "robot.r4.leaves_at_s=20.0")
    assert finding.level == "ok"


@pytest.mark.parametrize(
    ("override", "key", "text"),
    [
        ("robot.r2.joins_at_s=3.0", "robot.r2.joins_at_s", "from 0 s to 3 s, without r2"),
        ("robot.r2.leaves_at_s=20.0", "robot.r2.leaves_at_s", "from 20 s to 30 s, without r2"),
    ],
)
def test_who_is_cut_off_by_an_absent_robot_is_named(override: str, key: str, text: str) -> None:
    (finding,) = findings(override)
    assert (finding.level, finding.key) == ("warning", key)
    assert finding.text.startswith(f"{text}: the leader doesn't reach r3, r4")


def test_members_that_hear_the_leader_and_not_each_other_do_not_agree() -> None:
    links = "graph.leader=['r1', 'r3']"
    (finding,) = findings(links, "robot.r2.leaves_at_s=20.0")
    assert "no robot reaches all others" in finding.text


def test_a_robot_that_joins_in_agreement_changes_nothing_in_the_forecast() -> None:
    ahead = forecast(load("paper", ["coordination.v_hat_0=0.6", "robot.r4.joins_at_s=3.0"]))
    assert ahead.spread.max() < 1e-9
    assert ahead.speed_error.max() < 1e-9
    assert ahead.s[:, 3] == pytest.approx(ahead.s[:, 0], abs=1e-9)


def test_the_emulated_forecast_has_the_members_too() -> None:
    changes = "robot.r4.joins_at_s=3.0", "robot.r3.leaves_at_s=8.0"
    delay = "network.default={delay={kind='constant', delay_s=0.1}}"
    scenario = load("paper", [*SHORT, *changes])
    late = load("paper", [*SHORT, delay, *changes])
    plain, ahead = forecast(scenario), emulated_forecast(late, lambda _: LINE)
    assert np.array_equal(ahead.there, plain.there)
    assert ahead.spread.max() < 1e-4
    gone = ahead.t_s >= 8.0 + 1e-9
    assert (ahead.s_dot[gone, 2][1:] == 0.0).all()


def test_those_that_are_not_there_do_not_count_in_the_forecast() -> None:
    plain = forecast(load("paper"))
    left = forecast(load("paper", ["robot.r4.leaves_at_s=10.0"]))
    gone = left.t_s >= 10.0 - 1e-9
    assert np.array_equal(left.spread[~gone], plain.spread[~gone])
    assert (left.s_dot[gone, 3][1:] == 0.0).all()
    assert left.spread[gone] == pytest.approx(np.ptp(plain.s[gone][:, :3], axis=1), abs=1e-12)
