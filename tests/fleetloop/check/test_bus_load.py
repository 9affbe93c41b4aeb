"""What `fleetloop check` says of a scenario's buses."""

import dataclasses

import pytest

from bridge.wire.response_time import analyse
from configs.loading import load, loads, to_toml
from configs.resolve import robot_briefs, wire_model
from configs.scenario import Scenario
from fleetloop.check.bus_load import bus_findings, bus_messages
from fleetloop.check.finding import Finding

MS = 1_000_000


def found(*overrides: str) -> Finding:
    return first_of(load("paper", ("bus.timing='wire'", *overrides)))


def first_of(scenario: Scenario) -> Finding:
    return bus_findings(scenario, robot_briefs(scenario))[0]


def test_every_robot_has_its_bus_and_a_line_of_arithmetic() -> None:
    scenario = load("paper")
    findings = bus_findings(scenario, robot_briefs(scenario))
    assert [finding.robots for finding in findings] == [(f"r{n}",) for n in range(1, 5)]


def test_the_paper_at_1_khz_and_1_mbit_fits_with_the_figures_of_the_analysis() -> None:
    finding = found()
    assert finding.level == "ok"
    assert "6 messages" in finding.text
    assert "46.3% worst" in finding.text
    assert "takes up to 0.73 ms of its 1 ms" in finding.text


def test_mean_lengths_are_those_of_moving_wheels() -> None:
    robot = robot_briefs(load("paper"))[0]
    mean = {message.can_id: message.mean_bits for message in bus_messages([robot], MS)}
    assert mean[0x001] == 125
    assert mean[0x009] == pytest.approx(116, abs=1.5)
    assert mean[0x00E] == pytest.approx(83, abs=1.5)
    assert analyse(bus_messages([robot], MS), 1_000_000).mean_load == pytest.approx(0.4, abs=0.02)


def test_a_wire_over_the_ceiling_is_warned_of_with_the_numbers() -> None:
    finding = found("bus.bitrate_bit_s=500000")
    assert finding.level == "warning"
    for part in ("92.5% worst", "ceiling 70%", "too late", "all are due at once", "fewer robots"):
        assert part in finding.text


def test_more_than_the_wire_carries_is_refused_whatever_the_ceiling() -> None:
    finding = found("bus.bitrate_bit_s=250000", "bus.load_ceiling=1.0")
    assert finding.level == "error"
    assert "fewer robots" in finding.text


def test_an_ideal_bus_is_only_told_what_a_wire_could_not_do() -> None:
    finding = first_of(load("paper", ("bus.bitrate_bit_s=125000",)))
    assert finding.level == "warning"
    assert "may never be sent" in finding.text


def test_telemetry_counts_as_well() -> None:
    finding = found("drive.torques_period_s=0.001")
    assert finding.level == "warning"
    assert "8 messages" in finding.text


@pytest.mark.parametrize(("robots", "level"), [(5, "ok"), (7, "warning"), (20, "error")])
def test_seven_robots_at_200_hz_may_share_a_bus_twenty_may_not(robots: int, level: str) -> None:
    scenario = load("realtime_200hz", ("bus.timing='wire'",))
    one = robot_briefs(scenario)[0]
    shared = tuple(
        dataclasses.replace(one, robot=f"r{n}", bus="can0", right_node=2 * n, left_node=2 * n + 1)
        for n in range(robots)
    )
    # Of seven the last torque is late when all 14 heartbeats are due at once and at their longest.
    (finding,) = bus_findings(scenario, shared)
    assert finding.level == level, finding.text
    assert f"{robots} robots" in finding.title


def test_a_wire_is_described_to_the_plant_and_an_ideal_bus_is_none() -> None:
    assert wire_model(load("paper")) is None
    model = wire_model(load("paper", ("bus.timing='wire'", "bus.restart_s=0.1")))
    assert model is not None
    assert (model.bitrate_bit_s, model.txqueuelen, model.tx_mailboxes) == (1_000_000, 10, 3)
    assert (model.restart_ns, model.drive_restart_ns) == (100 * MS, None)


def test_a_bus_without_a_restart_survives_being_written_out() -> None:
    scenario = load("paper", ("bus.timing='wire'", "bus.drive_restart_s=0.0"))
    again = loads("again", to_toml(scenario))
    assert (again.bus.restart_s, again.bus.drive_restart_s) == (None, 0.0)
