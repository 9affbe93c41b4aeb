"""The classical Runge-Kutta step of fourth order for one robot, torques held over the step.

Written out on floats: this is the inner loop of the plant. The wheel angles are integrals of speeds
that are linear in (v, ω), so they come from the same stages. The step is a function of numbers; the
batch kernel of sweeps compiles it as it stands.
"""

from math import cos, sin

from plant.body import RigidBody, Rolling, Slipping, State, Waves, disturbance_torques, rates
from plant.divergence import FARTHEST

Motion = tuple[float, float, float, float, float, float, float]
"""The numbers of a `State`."""
Torques = tuple[float, float, float, float, float, float]
"""Net torques (right, left) [N·m] at the begin of a step, in its middle and at its end."""


def rk4(
    body: RigidBody, state: State, tau_right: float, tau_left: float, t_s: float, step_s: float
) -> State | None:
    """State after `step_s` from scenario time `t_s`, under held torques [N·m].

    None if the motion diverged: it would leave the bounds of `plant.divergence`.
    """
    try:
        return State(*moved(body, state, tau_right, tau_left, t_s, step_s))
    except ValueError:
        return None


def moved(
    body: RigidBody, motion: Motion, tau_right: float, tau_left: float, t_s: float, step_s: float
) -> Motion:
    """As `rk4`, of the numbers of states.

    Raises:
        ValueError: the motion diverged; also the sine of infinity.
    """
    if body.disturbed:
        net = net_torques(tau_right, tau_left, body.disturbs, t_s, step_s)
    else:
        net = (tau_right, tau_left, tau_right, tau_left, tau_right, tau_left)
    after = runge_kutta(
        body.rolling, body.slipping, motion, net, step_s, body.b, body.inv_right, body.inv_left
    )
    if not within_bounds(after, body.b, body.fastest_m_s):
        raise ValueError("the motion diverged")
    return after


def net_torques(
    tau_right: float, tau_left: float, waves: Waves, t_s: float, step_s: float
) -> Torques:
    """Torques less the disturbance, over a step from scenario time `t_s`."""
    right_1, left_1 = disturbance_torques(t_s, waves)
    right_2, left_2 = disturbance_torques(t_s + 0.5 * step_s, waves)
    right_4, left_4 = disturbance_torques(t_s + step_s, waves)
    return (
        *(tau_right - right_1, tau_left - left_1),
        *(tau_right - right_2, tau_left - left_2),
        *(tau_right - right_4, tau_left - left_4),
    )


def runge_kutta(
    rolling: Rolling,
    slipping: Slipping | None,
    motion: Motion,
    net: Torques,
    step_s: float,
    half_track: float,
    inv_right: float,
    inv_left: float,
) -> Motion:
    """The motion after a step, as it is computed: it may have diverged."""
    x, y, theta, v, omega, right_wheel_rad, left_wheel_rad = motion
    right_1, left_1, right_2, left_2, right_4, left_4 = net
    half = 0.5 * step_s
    a1, w1 = rates(rolling, slipping, v, omega, right_1, left_1)
    v2, omega2, theta2 = v + half * a1, omega + half * w1, theta + half * omega
    a2, w2 = rates(rolling, slipping, v2, omega2, right_2, left_2)
    v3, omega3, theta3 = v + half * a2, omega + half * w2, theta + half * omega2
    a3, w3 = rates(rolling, slipping, v3, omega3, right_2, left_2)
    v4, omega4, theta4 = v + step_s * a3, omega + step_s * w3, theta + step_s * omega3
    a4, w4 = rates(rolling, slipping, v4, omega4, right_4, left_4)

    sixth = step_s / 6.0
    along = sixth * (v + 2.0 * (v2 + v3) + v4)
    turn = sixth * (omega + 2.0 * (omega2 + omega3) + omega4)
    across = turn * half_track
    x += sixth * (v * cos(theta) + 2.0 * (v2 * cos(theta2) + v3 * cos(theta3)) + v4 * cos(theta4))
    y += sixth * (v * sin(theta) + 2.0 * (v2 * sin(theta2) + v3 * sin(theta3)) + v4 * sin(theta4))
    theta += turn
    v += sixth * (a1 + 2.0 * (a2 + a3) + a4)
    omega += sixth * (w1 + 2.0 * (w2 + w3) + w4)
    right_wheel_rad = right_wheel_rad + (along + across) * inv_right
    left_wheel_rad = left_wheel_rad + (along - across) * inv_left
    return x, y, theta, v, omega, right_wheel_rad, left_wheel_rad


def within_bounds(motion: Motion, half_track: float, fastest_m_s: float) -> bool:
    """Whether a motion is within the bounds of `plant.divergence`; what is no number isn't."""
    x, y, theta, v, omega, right_wheel_rad, left_wheel_rad = motion
    if not abs(v) + half_track * abs(omega) <= fastest_m_s:
        return False
    far = abs(x) + abs(y) + abs(theta) + abs(right_wheel_rad) + abs(left_wheel_rad)
    return far <= FARTHEST
