"""Effects of faults on robots of the plant, by closed forms."""

from itertools import count

import pytest
from support.robot_bench import NOWHERE

from bridge.fault_schedule import FaultSchedule
from configs.brief import PlantBrief
from configs.loading import load
from configs.resolve import plant_brief
from plant.faults import BusFaults
from plant.robot import EmulatedRobot, emulated_robot


class Bench:
    """A robot of two_robots that coasts without friction, and its faults."""

    def __init__(self, *faults: str, overrides: tuple[str, ...] = ()) -> None:
        body = (
            "body.com_offset_m",
            "body.damping_right_wheel_N_m_s",
            "body.damping_left_wheel_N_m_s",
        )
        still = [f"robot.r1.{key}=0.0" for key in ("v_m_s", *body)]
        scenario = load("two_robots", (f"fault=[{', '.join(faults)}]", *still, *overrides))
        brief: PlantBrief = plant_brief(scenario, network=NOWHERE)
        self.robot: EmulatedRobot = emulated_robot(brief.robots[0])
        self.faults = BusFaults(brief.faults, [self.robot], brief.schedule)
        self.h = brief.schedule.period_s
        self.body = self.robot._body
        self.ticks = count()

    @property
    def schedule(self) -> FaultSchedule:
        return self.faults.schedule

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            tick = next(self.ticks)
            self.faults.begin(tick)
            self.robot.advance(tick * self.h, self.h, 1)


def test_a_push_accelerates_the_body_by_force_over_mass_while_it_lasts() -> None:
    bench = Bench('{kind="push", at_s=0.1, for_s=0.2, robots=["r1"], force_body_N=3.0}')
    bench.run(50)
    assert bench.robot.state.v == 0.0
    bench.run(100)
    # ½ v² (m + 2 I_w / r²) is the kinetic energy: the inertia that a force along the axis meets.
    inertia_kg = 2.0 * bench.body.mbar_1 / bench.body.r**2
    assert bench.robot.state.v == pytest.approx(3.0 * 0.2 / inertia_kg, rel=1e-9)
    bench.run(50)
    assert bench.robot.state.v == pytest.approx(3.0 * 0.2 / inertia_kg, rel=1e-9)
    assert bench.robot.row(0.0)[-2:] == (0.0, 0.0)


def test_a_pushed_torque_turns_the_body() -> None:
    bench = Bench('{kind="push", at_s=0.0, robots=["r1"], force_body_N=0.0, torque_body_N_m=0.1}')
    bench.run(100)
    inertia_kg_m2 = 2.0 * bench.body.mbar_2 * bench.body.b**2 / bench.body.r**2
    assert bench.robot.state.omega == pytest.approx(0.1 * 0.2 / inertia_kg_m2, rel=1e-9)
    assert bench.robot.state.v == pytest.approx(0.0, abs=1e-12)


def test_two_pushes_add_and_the_end_of_one_leaves_the_other() -> None:
    bench = Bench(
        '{kind="push", at_s=0.0, robots=["r1"], force_body_N=3.0}',
        '{kind="push", at_s=0.0, for_s=0.1, robots=["r1"], force_body_N=-3.0}',
    )
    bench.run(50)
    assert bench.robot.state.v == pytest.approx(0.0, abs=1e-12)
    bench.run(50)
    inertia_kg = 2.0 * bench.body.mbar_1 / bench.body.r**2
    assert bench.robot.state.v == pytest.approx(3.0 * 0.1 / inertia_kg, rel=1e-9)
