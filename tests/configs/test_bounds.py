"""Numbers that no clock and no physics can take are errors of the file; what is right is said."""

from pathlib import Path

import pytest

from configs.connections import NetworkLink
from configs.deployment import check_deployment
from configs.errors import ScenarioError
from configs.files import expanded
from configs.loading import load
from configs.resolve import plant_brief, schedule
from configs.ticks import Ticks


@pytest.mark.parametrize(
    ("override", "right"),
    [
        ("duration_s=1e308", "duration_s=1e308: must be 1e+09 or less"),
        ("duration_s=inf", "duration_s=inf: must be a finite number"),
        ("clock.control_period_s=1e300", "must be 1e+09 or less"),
        ("clock.countdown_s=1e308", "must be 1e+09 or less"),
        ("clock.share_period_s=1e308", "must be 1e+09 or less"),
        ("clock.tick_deadline_s=1e308", "must be 1e+09 or less"),
        ("clock.plant_step_s=1e-300", "must be 1e-06 or more"),
        ("localisation.delay_s=1e9", "must be 60 or less"),
        ("drive.watchdog_s=1e300", "must be 1e+09 or less"),
        ("drive.boot_s=1e308", "must be 1e+09 or less"),
        ("host.rearm_after_s=1e308", "must be 1e+09 or less"),
        ("coordination.silence_limit_s=1e308", "must be 1e+09 or less"),
        ("leader.steps=[{t_s=1e308, speed_m_s=1.0}]", "must be 1e+09 or less"),
        ("leader.speed_m_s=-1e300", "must be -1e+12 or more"),
        ("robot.r1.pose.x_m=1e308", "must be 1e+12 or less"),
        ("mounting.gear_ratio=1e-308", "must be 1e-06 or more"),
        ("seed=100000000000000000000", "must be 9007199254740991 or less"),
    ],
)
def test_a_number_beyond_all_bounds_is_refused(override: str, right: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        load("two_robots", (override,))
    assert right in str(refused.value)


def test_the_longest_run_still_counts_its_nanoseconds_in_64_bits() -> None:
    scenario = load("two_robots", ("duration_s=1e9", "clock.countdown_s=1e9"))
    ticks = schedule(scenario)
    assert Ticks(ticks).bus_time_ns(ticks.ticks) == 2_000_000_000_000_000_000 < 1 << 63
    assert plant_brief(scenario, network=NetworkLink("", "", "", "")).schedule == ticks


@pytest.mark.parametrize("key", ["users", "tls.ca"])
def test_a_home_of_nobody_is_an_error_of_the_deployment(key: str) -> None:
    network: dict[str, object] = {"endpoint": "tls/127.0.0.1:7447", "users": "~nosuchuser/x"}
    if key == "tls.ca":
        files = {"ca": "~nosuchuser/x", "certificate": "a.pem", "private_key": "a.key"}
        network = {"endpoint": "tls/127.0.0.1:7447", "tls": files}
    with pytest.raises(ScenarioError, match=f"network.{key} = ~nosuchuser/x: no such user"):
        check_deployment("d.toml", {"network": network}, load("two_robots"), Path())


def test_a_zero_byte_is_in_no_file_name() -> None:
    with pytest.raises(ScenarioError, match=r"users = 'a\\x00b': no file has a zero byte"):
        expanded(Path("a\0b"), "users")
