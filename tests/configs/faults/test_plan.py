"""Section [[fault]]: names, targets, ticks, and faults that can't act."""

import pytest
from support.robot_bench import NOWHERE
from support.scenario_text import SMALL, changed, problems

from configs.faults.kinds import CLASSES, KINDS
from configs.faults.plan import fault_window, planned_faults
from configs.loading import load, loads
from configs.resolve import agent_brief, plant_brief
from configs.scenario import Scenario


def with_faults(*faults: str) -> Scenario:
    return load("two_robots", (f"fault=[{', '.join(faults)}]",))


def test_every_kind_has_one_class_and_a_docstring() -> None:
    assert len(set(CLASSES)) == len(CLASSES)
    assert len(KINDS) >= 40
    assert all(cls.__doc__ for cls in CLASSES)


def test_a_fault_without_a_name_is_named_by_its_kind_and_a_number() -> None:
    scenario = with_faults(
        '{kind="push", at_s=1.0, name="push_2"}',
        '{kind="push", at_s=1.0}',
        '{kind="push", at_s=1.0}',
        '{kind="drive_estop", at_s=1.0, robots=["r2"]}',
    )
    names = [one.name for one in planned_faults(scenario)]
    assert names == ["push_2"] * 2 + ["push"] * 2 + ["push_3"] * 2 + ["drive_estop"]


def test_a_fault_acts_from_the_first_tick_at_or_after_its_time_for_its_duration() -> None:
    scenario = with_faults('{kind="push", at_s=1.0001, for_s=0.002, robots=["r1"]}')
    (planned,) = planned_faults(scenario)
    assert (planned.target, planned.from_tick, planned.to_tick) == ("r1", 501, 502)
    assert fault_window(scenario, "push") == (1.0001, pytest.approx(1.0021))
    assert fault_window(scenario, "pull") is None
    assert fault_window(with_faults('{kind="push", at_s=1.0}'), "push") == (1.0, None)
    assert fault_window(with_faults('{kind="drive_reboot", at_s=1.0}'), "drive_reboot") == (1, 1)


def test_each_process_is_told_the_faults_that_act_in_it() -> None:
    scenario = with_faults(
        '{kind="push", at_s=1.0}',
        '{kind="link_partition", at_s=1.0, edges=["* -> *", "leader -> r1"]}',
        '{kind="localisation_outage", at_s=1.0, robots=["r1"]}',
    )
    of_plant = plant_brief(scenario, network=NOWHERE).faults
    assert [one.target for one in of_plant] == ["r1", "r2"]
    of_agents = {
        robot: [
            (one.fault.kind, one.target)
            for one in agent_brief(scenario, robot, network=NOWHERE, bus=()).faults
        ]
        for robot in scenario.names
    }
    assert of_agents == {
        "r1": [("link_partition", "leader -> r1"), ("localisation_outage", "r1")],
        "r2": [("link_partition", "r1 -> r2")],
    }
    assert scenario.aged("r2") == ("r1",)
    assert scenario.aged("r1") == ("leader", "localisation")


@pytest.mark.parametrize(
    ("fault", "key", "right"),
    [
        ('{kind="puhs", at_s=1.0}', "fault.0.kind", "'push'"),
        ('{kind="push"}', "fault.0.at_s", "must be given"),
        ('{kind="push", at_s=-1.0}', "fault.0.at_s", "0"),
        ('{kind="push", at_s=30.0}', "fault.0.at_s", "the run ends before"),
        ('{kind="push", at_s=29.9995}', "fault.0.at_s", "the run ends before"),
        ('{kind="push", at_s=1.0003, for_s=0.0001}', "fault.0.for_s", "no tick from 1.0003 s"),
        ('{kind="push", at_s=1.0, for_s=0.0}', "fault.0.for_s", "greater than 0"),
        ('{kind="push", at_s=1.0, force_N=1.0}', "fault.0.force_N", "did you mean force_body_N?"),
        ('{kind="push", at_s=1.0, robots=["r9"]}', "fault.0.robots", "known: r1, r2"),
        ('{kind="push", at_s=1.0, robots=["r1", "r1"]}', "fault.0.robots", "is named twice"),
        ('{kind="drive_estop", at_s=1.0, for_s=1.0}', "fault.0.for_s = 1.0", "leave it out"),
        (
            '{kind="pusch", at_s=1.0}',
            'fault.0.kind = "pusch"',
            "'process_slow'; did you mean push?",
        ),
        ('{kind="torque_half", at_s=1.0, wheel="front"}', "fault.0.wheel", "'right'"),
        ('{kind="link_loss", at_s=1.0, edges=["r1 > r2"]}', "fault.0.edges", "r1 -> r2"),
        ('{kind="link_loss", at_s=1.0, edges=["r2 -> r1"]}', "fault.0.edges", "no such edge"),
        ('{kind="under_voltage", at_s=1.0}', "fault.0.kind", "drive.preset = 'realistic'"),
        ('{kind="can_corrupt", at_s=1.0}', "fault.0.kind", "bus.timing = 'wire'"),
        ('{kind="node_bus_off", at_s=1.0}', "fault.0.kind", "bus.timing = 'wire'"),
        ('{kind="node_babbling", at_s=1.0}', "fault.0.kind", "bus.timing = 'wire'"),
        ('{kind="can_drop", at_s=1.0, count=0}', "fault.0.count", "1"),
        ('{kind="can_delay", at_s=1.0, delay_s=0.0}', "fault.0.delay_s", "greater than 0"),
        ('{kind="can_drop", at_s=1.0, direction="up"}', "fault.0.direction", "'to_drives'"),
        ('{kind="drive_error", at_s=1.0, error="HICCUP"}', "fault.0.error", "known: DRV_FAULT,"),
        (
            '{kind="push", at_s=1.0, force_body_N=0.0}',
            "fault.0.force_body_N = 0.0",
            "changes nothing",
        ),
        (
            '{kind="friction", at_s=1.0, factor=1.0}',
            "fault.0.factor",
            "changes nothing with factor = 1",
        ),
        ('{kind="wheel_slip", at_s=1.0, ratio=0.0}', "fault.0.ratio", "greater than 0"),
        (
            '{kind="localisation_bias", at_s=1.0, x_m=0.0}',
            "fault.0.x_m",
            "changes nothing with x_m",
        ),
        ('{kind="payload", at_s=1.0, robots=["r1"], mass_kg=-2.3}', "mass_kg", "r1 has 2.3"),
        ('{kind="payload", at_s=1, robots=["r2"], inertia_kg_m2=-0.02}', "inertia", "r2 has 0.01"),
    ],
)
def test_a_fault_that_is_wrong_or_cannot_act_is_one_line(fault: str, key: str, right: str) -> None:
    (line,) = problems(SMALL + '[graph]\nedges=["r1 -> r2"]\nleader=["r1"]\n', f"fault=[{fault}]")
    assert key in line
    assert right in line


def test_two_faults_of_one_name_are_refused() -> None:
    twice = 'fault=[{kind="push", at_s=1.0, name="a"}, {kind="payload", at_s=2.0, name="a"}]'
    (line,) = problems(SMALL, twice)
    assert "fault.1.name" in line
    assert "another fault has this name" in line


def sense(fault: str, *overrides: str) -> list[str]:
    return problems(SMALL, f"fault=[{fault}]", *overrides)


def taken(fault: str, *overrides: str) -> bool:
    return bool(loads("small", changed(SMALL, f"fault=[{fault}]", *overrides)).fault)


def test_loads_count_together_while_they_act_together() -> None:
    gone = '{kind="payload", at_s=1.0, robots=["r1"], mass_kg=-2.0}'
    held = '{kind="payload", at_s=0.5, for_s=1.0, robots=["r1"], mass_kg=1.0}'
    more = '{kind="payload", at_s=%s, for_s=0.2, robots=["r1"], mass_kg=-1.0}'
    assert taken(f"{gone}, {held}")
    assert taken(f"{gone}, {held}, {more % 1.2}")
    lines = sense(f"{gone}, {held}, {more % 1.4}")
    assert len(lines) == 2
    assert all("r1 has 2.3, of which 3 or more would go" in line for line in lines)


def test_what_a_scenario_leaves_without_effect_is_refused() -> None:
    (line,) = sense('{kind="drive_watchdog", at_s=1.0}', "drive.watchdog_s=0.0")
    assert "needs drive.watchdog_s above 0" in line
    (line,) = sense('{kind="localisation_jump", at_s=1.0}', 'localisation.source="odometry"')
    assert "poses aren't used" in line
    undamped = "robot.r1.body.damping_left_wheel_N_m_s=0.0"
    (line,) = sense('{kind="friction", at_s=1.0, wheel="left"}', undamped)
    assert "r1's body.damping_left_wheel_N_m_s is 0" in line
    for fault, right in (
        ('{kind="under_voltage", at_s=1.0, voltage_V=25.0}', "below supply.voltage_V = 24"),
        ('{kind="over_voltage", at_s=1.0, voltage_V=23.0}', "above supply.voltage_V = 24"),
    ):
        (line,) = sense(fault, 'drive.preset="realistic"')
        assert right in line


def test_a_protocol_says_which_faults_its_drives_can_have() -> None:
    plain = 'drive.protocol="support.second_drive:ROW"'
    assert taken('{kind="drive_error", at_s=1.0, error="LOST_PHASE"}', plain)
    (line,) = sense('{kind="drive_error", at_s=1.0, error="DRV_FAULT"}', plain)
    assert "known: OVER_LOAD, LOST_PHASE" in line
    (line,) = sense('{kind="drive_watchdog", at_s=1.0}', plain)
    assert "these drives have no watchdog" in line
