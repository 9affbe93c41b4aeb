"""A law, a path or a path variable that diverges stops its robot; its controller goes on."""

import struct
from dataclasses import replace
from math import isfinite, isnan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.controller_rows import COLUMNS
from support.robot_bench import SCENARIO, ZERO, Bench, set_points

from agents.guard import Phase
from agents.laws.dsc_terms import Projection
from bridge.network.messages import PathState
from configs.connections import NetworkLink
from configs.curves import SplinePath
from configs.paths import AT_CENTRE
from configs.plugins import LAWS
from configs.resolve import agent_brief
from configs.sections import LAW

BRIEF = agent_brief(SCENARIO, "r2", network=NetworkLink("test", "", "", ""), bus=())
STANDSTILL = ((1.0, 0.0, 0.0, 0.0, 0.0, 0.0),)
FLT_MAX = 3.4028234663852886e38
ABSURD = (FLT_MAX, -FLT_MAX, 1e30, -1e20, 1e-45, -0.0, 1e6)


def rows_of(bench: Bench) -> list[dict[str, float]]:
    bench.agent.rows.finish()
    return [dict(zip(COLUMNS, values, strict=True)) for values in bench.rows]


def test_a_path_that_stands_still_stops_the_robot_and_names_the_place() -> None:
    path = SplinePath((0.0, 1.0), STANDSTILL, STANDSTILL, closed=False)
    bench = Bench("r2", path=path, offset=AT_CENTRE)
    bench.run(bench.schedule.countdown_ticks)
    for _ in range(50):
        assert set_points(bench.tick()) in ([ZERO, ZERO], [])
    assert bench.phase is Phase.STOPPED
    assert bench.why == (
        "tick 0 (t = 0.000 s): law adaptive_dsc diverged at s = 0 m: float division by zero"
    )
    rows = rows_of(bench)
    assert [row["t_s"] for row in rows] == pytest.approx([0.002 * k for k in range(50)])
    assert isnan(rows[-1]["x_d_m"])
    assert rows[-1]["s"] > rows[0]["s"]  # neighbours go on hearing of it


@pytest.mark.parametrize("far", [1e308, -1.7e308])
def test_a_pose_beyond_all_numbers_stops_the_robot(far: float) -> None:
    bench = Bench()
    bench.drive(5)
    bench.pose = (far, -far, far)
    bench.until(Phase.STOPPED, within=1000)
    bench.run(20)


def test_a_path_variable_that_diverges_stays_where_it_was_a_number_and_stops_the_robot() -> None:
    bench = Bench("r2", coordination=replace(BRIEF.coordination, q=1e308))
    bench.drive(1)
    bench.run(20)
    assert bench.phase is Phase.STOPPED
    assert "its path variable diverged" in bench.why
    said = bench.agent.share(21)
    assert PathState.decode(said.encode()) == said


def test_gains_beyond_all_numbers_are_no_reason_to_fail_before_the_run() -> None:
    assert Projection.of(1e200, 1e200).square > 1e308
    gains = replace(BRIEF.law.parameters, sigma_max=1e200, k4=1e308, sgn_width=1e-320)
    bench = Bench("r2", law=replace(BRIEF.law, parameters=gains))
    bench.run(bench.schedule.countdown_ticks + 20)
    assert bench.phase in (Phase.STOPPED, Phase.DRIVING)


@settings(deadline=None, max_examples=100)
@given(
    law=st.sampled_from(sorted(LAWS)),
    source=st.sampled_from(["fused", "external", "odometry"]),
    wheels=st.lists(st.tuples(*[st.sampled_from(ABSURD)] * 4), min_size=1, max_size=5),
)
def test_whatever_encoders_say_the_controller_lives_and_sends_numbers(
    law: str, source: str, wheels: list[tuple[float, float, float, float]]
) -> None:
    host = replace(BRIEF.host, encoder_mismatch_limit_wheel_rad=1e300)
    bench = Bench("r2", law=LAW.choose({"law": law}, ""), localisation=source, host=host)
    bench.drive(3)
    for right, left, right_speed, left_speed in wheels:
        bench.axes[0].update_encoder(right, right_speed)
        bench.axes[1].update_encoder(left, left_speed)
        for data in set_points(bench.tick()):
            assert isfinite(struct.unpack("<f", data)[0])
        said = bench.agent.share(bench.tick_now)
        assert PathState.decode(said.encode()) == said
