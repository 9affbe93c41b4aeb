"""Every signal that a run records of every robot at every tick, and those that are made of them.

The plant tells the truth about a robot; its controller tells what it used and commanded. These
tables are the only place that knows the signals and their order: rows, record, export, figures and
diff go by name, and a scenario's expectations are checked against them.
"""

from typing import NamedTuple


class Signal(NamedTuple):
    """One recorded signal."""

    name: str
    unit: str
    meaning: str


PLANT_SIGNALS: tuple[Signal, ...] = (
    Signal("t_s", "s", "scenario time of the tick"),
    Signal("x_m", "m", "true position, world"),
    Signal("y_m", "m", "true position, world"),
    Signal("theta_rad", "rad", "true heading, not wrapped"),
    Signal("v_m_s", "m/s", "true forward speed"),
    Signal("omega_rad_s", "rad/s", "true turn rate"),
    Signal(
        "input_right_wheel_N_m",
        "N·m",
        "torque at the wheel that the right drive was last told, before limits",
    ),
    Signal(
        "input_left_wheel_N_m",
        "N·m",
        "torque at the wheel that the left drive was last told, before limits",
    ),
    Signal(
        "demand_right_wheel_N_m",
        "N·m",
        "torque at the wheel, asked of the right motor at last, after limits",
    ),
    Signal(
        "demand_left_wheel_N_m",
        "N·m",
        "torque at the wheel, asked of the left motor at last, after limits",
    ),
    Signal("motor_right_wheel_N_m", "N·m", "torque that the right wheel felt at last"),
    Signal("motor_left_wheel_N_m", "N·m", "torque that the left wheel felt at last"),
)
"""Truth of one robot at one tick, before the controller answers."""

LAW_SIGNALS: tuple[Signal, ...] = (
    Signal("x_e_m", "m", "path following error, (8)"),
    Signal("y_e_m", "m", "path following error, (8)"),
    Signal("theta_e_rad", "rad", "path following error, (8), in (−π, π]"),
    Signal("alpha_theta_rad", "rad", "filtered virtual control, (19)"),
    Signal("alpha_v_m_s", "m/s", "filtered virtual control, (20)"),
    Signal("alpha_omega_rad_s", "rad/s", "filtered virtual control, (27)"),
    Signal("xi_e1_m_s", "m/s", "speed error, (30)"),
    Signal("xi_e2_rad_s", "rad/s", "turn rate error, (30)"),
    Signal("theta_hat_1", "kg·m²", "estimate of c b"),
    Signal("theta_hat_2", "N·m·s", "estimate of d̄_11"),
    Signal("theta_hat_3", "N·m·s", "estimate of d̄_12"),
    Signal("theta_hat_4", "kg·m²", "estimate of m̄_1"),
    Signal("theta_hat_5", "kg·m²", "estimate of c / b"),
    Signal("theta_hat_6", "N·m·s", "estimate of d̄_21"),
    Signal("theta_hat_7", "N·m·s", "estimate of d̄_22"),
    Signal("theta_hat_8", "kg·m²", "estimate of m̄_2"),
    Signal("kappa_hat", "N·m", "estimate of the disturbance bound, (36)"),
)
"""What a law says of one tick."""

AGENT_SIGNALS: tuple[Signal, ...] = (
    Signal("t_s", "s", "scenario time of the tick"),
    Signal("x_used_m", "m", "position that the controller used"),
    Signal("y_used_m", "m", "position that the controller used"),
    Signal("theta_used_rad", "rad", "heading that the controller used"),
    Signal("v_used_m_s", "m/s", "forward speed that the controller used"),
    Signal("omega_used_rad_s", "rad/s", "turn rate that the controller used"),
    Signal("s", "m", "path variable"),
    Signal("s_dot", "m/s", "its rate, mu + v_r_hat"),
    Signal("mu", "m/s", "coordination state of (40)"),
    Signal("v_r_hat", "m/s", "estimate of the reference speed, (38)"),
    Signal("neighbours", "1", "in-neighbours that counted in the sums"),
    Signal("x_d_m", "m", "reference position, (1)"),
    Signal("y_d_m", "m", "reference position, (1)"),
    Signal("theta_d_rad", "rad", "reference heading, (8)"),
    *LAW_SIGNALS,
    Signal(
        "tau_right_wheel_N_m",
        "N·m",
        "torque commanded at the wheel, as float32 on the bus carries it",
    ),
    Signal(
        "tau_left_wheel_N_m",
        "N·m",
        "torque commanded at the wheel, as float32 on the bus carries it",
    ),
    Signal("late_s", "s", "in real time, wall time from the tick's due time to its computation"),
    Signal("round_trip_s", "s", "in real time, from the last torques sent to their feedback"),
)
"""One controller at one tick: what it used and what it commanded."""

SPREAD = "s_spread"
"""max_i s_i − min_i s_i over robots [m], of what is recorded of each."""


def expectable() -> tuple[str, ...]:
    """What an expectation may be about, sorted."""
    recorded = {signal.name for signal in (*PLANT_SIGNALS, *AGENT_SIGNALS)}
    return tuple(sorted(recorded | {SPREAD}))
