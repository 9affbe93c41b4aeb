"""The classical Runge-Kutta step of fourth order for one robot, torques held over the step.

Written out on floats: this is the inner loop of the plant. The wheel angles are integrals of speeds
that are linear in (v, ω), so they come from the same stages.
"""

from math import cos, sin
from typing import Final

from plant.body import RigidBody, State
from plant.divergence import FARTHEST

_new: Final = tuple.__new__  # of a named tuple, past its constructor: this is the hot path


def rk4(
    body: RigidBody, state: State, tau_right: float, tau_left: float, t_s: float, step_s: float
) -> State | None:
    """State after `step_s` from scenario time `t_s`, under held torques [N·m].

    None if the motion diverged: it would leave the bounds of `plant.divergence`.
    """
    try:
        x, y, theta, v, omega, right_wheel_rad, left_wheel_rad = state
        accelerations = body.accelerations
        half = 0.5 * step_s
        if body.disturbed:
            right_1, left_1 = body.net(tau_right, tau_left, t_s)
            right_2, left_2 = body.net(tau_right, tau_left, t_s + half)
            right_4, left_4 = body.net(tau_right, tau_left, t_s + step_s)
        else:
            right_1 = right_2 = right_4 = tau_right
            left_1 = left_2 = left_4 = tau_left
        a1, w1 = accelerations(v, omega, right_1, left_1)
        v2, omega2, theta2 = v + half * a1, omega + half * w1, theta + half * omega
        a2, w2 = accelerations(v2, omega2, right_2, left_2)
        v3, omega3, theta3 = v + half * a2, omega + half * w2, theta + half * omega2
        a3, w3 = accelerations(v3, omega3, right_2, left_2)
        v4, omega4, theta4 = v + step_s * a3, omega + step_s * w3, theta + step_s * omega3
        a4, w4 = accelerations(v4, omega4, right_4, left_4)

        sixth = step_s / 6.0
        along = sixth * (v + 2.0 * (v2 + v3) + v4)
        turn = sixth * (omega + 2.0 * (omega2 + omega3) + omega4)
        across = turn * body.b
        x += sixth * (
            v * cos(theta) + 2.0 * (v2 * cos(theta2) + v3 * cos(theta3)) + v4 * cos(theta4)
        )
        y += sixth * (
            v * sin(theta) + 2.0 * (v2 * sin(theta2) + v3 * sin(theta3)) + v4 * sin(theta4)
        )
        theta += turn
        v += sixth * (a1 + 2.0 * (a2 + a3) + a4)
        omega += sixth * (w1 + 2.0 * (w2 + w3) + w4)
        right_wheel_rad = right_wheel_rad + (along + across) * body.inv_right
        left_wheel_rad = left_wheel_rad + (along - across) * body.inv_left
    except ValueError:  # the sine of infinity
        return None
    if not abs(v) + body.b * abs(omega) <= body.fastest_m_s:
        return None
    if not abs(x) + abs(y) + abs(theta) + abs(right_wheel_rad) + abs(left_wheel_rad) <= FARTHEST:
        return None
    return _new(State, (x, y, theta, v, omega, right_wheel_rad, left_wheel_rad))
