"""What a controller says for people is what it records."""

import pytest
from support.robot_bench import Bench

from agents.status import Narrator
from bridge.network.status import Heard


def test_before_tick_0_it_is_arming_and_knows_nothing_yet() -> None:
    bench = Bench("r2")
    said = Narrator(bench.agent).status(bench.tick_now)
    assert said.phase == "arming"
    assert said[1:6] == (None,) * 5
    # Its neighbour's start value is as old as the instant before.
    assert said.heard == (Heard("r1", pytest.approx(bench.schedule.period_s)),)


def test_errors_and_torques_are_those_of_the_row_of_the_tick() -> None:
    bench = Bench("r2")
    while bench.tick_now < 20:
        bench.tick()
    said = Narrator(bench.agent).progress(19)
    bench.agent.rows.finish()
    names = [signal.name for signal in bench.agent.brief.signals]
    row = dict(zip(names, bench.rows[19], strict=True))
    assert (said.tick, said.t_ns) == (19, 19 * bench.schedule.period_ns)
    assert said.status is not None
    assert said.status[:6] == (
        "driving",
        *(row[it] for it in ("x_e_m", "y_e_m", "theta_e_rad")),
        *(row[it] for it in ("tau_right_wheel_N_m", "tau_left_wheel_N_m")),
    )


def test_a_stopped_robot_says_so() -> None:
    bench = Bench("r2")
    while bench.tick_now < 5:
        bench.tick()
    bench.agent.guard.note_fault("encoders", "a fault")
    bench.tick()
    assert Narrator(bench.agent).status(5).phase == "stopped"
