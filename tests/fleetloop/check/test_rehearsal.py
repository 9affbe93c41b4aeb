"""What a rehearsal sees of a run that would go wrong."""

import pytest

from configs.loading import load
from fleetloop.check.finding import worst
from fleetloop.check.rehearsal import rehearse

SHORT = "duration_s=10.0", "expect=[]"


def test_a_short_scenario_that_works_is_rehearsed_to_its_end() -> None:
    (finding,) = rehearse(load("two_robots_100hz", SHORT))
    assert finding.level == "ok"
    assert "all 10 s" in finding.text


def test_robots_that_stop_themselves_are_named_with_the_reason() -> None:
    found = rehearse(
        load(
            "two_robots_100hz",
            (*SHORT, "control={law='adaptive_dsc', k4=3.0}", "drive={preset='ideal'}"),
        )
    )
    assert worst(found) == "error"
    assert {robot for finding in found for robot in finding.robots} == {"r1", "r2"}


def test_robots_that_end_off_their_paths_are_named() -> None:
    weak = "control.torque_limit_wheel_N_m=0.1", "duration_s=12.0", "expect=[]"
    found = rehearse(load("two_robots_100hz", weak))
    assert worst(found) == "error"
    assert all("off its path at the end" in finding.text for finding in found)


def test_drives_that_are_not_armed_in_time_end_it() -> None:
    found = rehearse(load("two_robots_100hz", (*SHORT, "drive.calibrated=false")))
    assert worst(found) == "error"
    assert "would end" in found[0].text


@pytest.mark.parametrize("name", ["realistic", "two_robots"])
def test_shipped_scenarios_get_through(name: str) -> None:
    assert worst(rehearse(load(name))) == "ok"
