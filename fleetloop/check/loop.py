"""The sampled loops of one robot, near its path: spectral radius, delay margin, gains that suit.

Speed loop (29)-(34), output held, torque late by D whole and f of a period, K = k_4 h / min(m̄):

    z^(D+2) − z^(D+1) + K ((1 − f) z + f) = 0                                               (1)

which is stable for K < 2 sin(π / (2 (2 D + 1))) where f = 0.

Whole channel: the robot's own law and body, linearised by differences about motion along a line or
an arc at constant speed. State: pose, speeds, the law's fast states, torques on their way, poses on
their way, the pose that is held between fixes; the map goes from one fix to the next and is taken
per control period. The law brings its part as a `LoopElement`: what adapts is held.           (2)
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, sin
from operator import add
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.laws.interface import (
    Law,
    LoopElement,
    PathVariable,
    Reference,
    RobotMotion,
    RobotPath,
    Theta,
)
from configs.brief import Wheels
from plant.body import RigidBody, State
from plant.integrate import rk4

Vector = NDArray[np.float64]
_NUDGE = 1e-6
MAX_PERIODS = 200
"""Control periods between two fixes that are simulated; longer ones are taken as this."""


@dataclass(frozen=True, slots=True)
class Loop:
    """Parameters of one robot's loops."""

    law: type[Law]
    gains: Any
    wheels: Wheels
    body: RigidBody
    period_s: float
    torque_delay_s: float
    pose_every: int
    """Control periods for which a pose is held; 1 if odometry carries it on."""
    pose_delay: int
    """Control periods that a held pose is old when it comes."""
    learnt: bool = False
    """Whether what adapts is held where it may end up, not at its start."""


def true_theta(body: RigidBody) -> Theta:
    """Θ of (32): (c b, d̄_11, d̄_12, m̄_1, c/b, d̄_21, d̄_22, m̄_2)."""
    right, left = body.damping_wheel_N_m_s
    mean, half = 0.5 * (right + left), 0.5 * (right - left)
    c, b = body.c, body.b
    return c * b, mean, b * half, body.mbar_1, c / b, half / b, mean, body.mbar_2


def elements(loop: Loop, v_bar: float, omega_bar: float, s_dot: float) -> tuple[LoopElement, ...]:
    """The law's own on an arc of this v̄_d and ω̄_d at speed ṡ > 0; none if it has no such."""
    path = _Frame(v_bar * s_dot, omega_bar * s_dot).path(v_bar, omega_bar, s_dot)
    along, theta = PathVariable(0.0, s_dot, 0.0), true_theta(loop.body)
    found = loop.law.loop_elements(loop.gains, loop.wheels, loop.period_s, path, along, theta)
    return () if found is None else tuple(found)


def speed_loop_radius(gain: float, delay_periods: float) -> float:
    """Spectral radius of (1) for K and a delay in control periods."""
    whole = int(delay_periods)
    part = delay_periods - whole
    polynomial = np.zeros(whole + 3)
    polynomial[0], polynomial[1] = 1.0, -1.0
    polynomial[-2] += gain * (1.0 - part)
    polynomial[-1] += gain * part
    return float(np.abs(np.roots(polynomial)).max())


def channel_radius(loop: Loop, v_bar: float, omega_bar: float, s_dot: float) -> float:
    """Spectral radius of (2) per control period, on an arc of this v̄_d and ω̄_d at speed ṡ."""
    periods, late = min(loop.pose_every, MAX_PERIODS), min(loop.pose_delay, MAX_PERIODS)
    tick = -late % periods  # of an interval, at which the pose is that becomes a fix
    whole = _whole_map(_interval(loop, v_bar, omega_bar, s_dot, tick), waits=-(-late // periods))
    largest = float(np.abs(np.linalg.eigvals(whole)).max())
    return float(largest ** (1.0 / periods))


def _whole_map(interval: Vector, *, waits: int) -> Vector:
    """The map from fix to fix; its state ends with the fixes on their way, the next one first.

    `interval` goes from state and fix, its last three inputs, to the state an interval later and
    the pose that is the fix `waits` intervals later; without waiting the pose of the state itself.
    """
    state = interval.shape[1] - 3
    on, used = interval[:, :state], interval[:, state:]
    if waits == 0:
        on[:state, :3] += used[:state]
        return on[:state]
    size = state + 3 * waits
    whole = np.zeros((size, size))
    whole[:state, :state], whole[:state, state : state + 3] = on[:state], used[:state]
    whole[state : size - 3, state + 3 :] = np.eye(3 * (waits - 1))
    whole[size - 3 :, :state] = on[state:]
    whole[size - 3 :, state : state + 3] += used[state:]
    return whole


def delay_margin_s(loop: Loop, v_bar: float, omega_bar: float, s_dot: float) -> float:
    """How much later torques may still come before (2) is unstable; 0 if it is already."""

    def stable(extra: float) -> bool:
        later = replace(loop, torque_delay_s=loop.torque_delay_s + extra)
        return channel_radius(later, v_bar, omega_bar, s_dot) < 1.0 + 1e-9

    most = 20.0 * loop.period_s
    return bisect(stable, 0.0, most, 6)


def largest_gain(loop: Loop, name: str, v_bar: float, omega_bar: float, s_dot: float) -> float:
    """The largest value of a gain up to today's with which (2) is stable; 0: none."""

    def stable(value: float) -> bool:
        return channel_radius(with_gain(loop, name, value), v_bar, omega_bar, s_dot) < 1.0 - 1e-6

    return bisect(stable, 0.0, getattr(loop.gains, name), 7)


def with_gain(loop: Loop, name: str, value: float) -> Loop:
    """The loop with another value of one gain."""
    return replace(loop, gains=replace(loop.gains, **{name: value}))


def bisect(holds: Callable[[float], bool], low: float, high: float, steps: int) -> float:
    """The largest value between `low` and `high` for which a condition holds, about."""
    if holds(high):
        return high
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _interval(loop: Loop, v_bar: float, omega_bar: float, s_dot: float, tick: int) -> Vector:
    """What small deviations of state and fix make of the state after an interval between fixes.

    Its last three rows are the pose at a tick of the interval.
    """
    h, periods = loop.period_s, min(loop.pose_every, MAX_PERIODS)
    late_s = min(loop.pose_delay, MAX_PERIODS) * h
    whole = int(loop.torque_delay_s / h)
    part = loop.torque_delay_s / h - whole
    v, omega = v_bar * s_dot, omega_bar * s_dot
    at = _Frame(v, omega)
    path = at.path(v_bar, omega_bar, s_dot)
    steady = loop.body.wheel_torques(v, omega, 0.0, 0.0)
    element = elements(loop, v_bar, omega_bar, s_dot)[-1 if loop.learnt else 0]
    queue_at = 5 + len(element.steady)
    size = queue_at + 2 * (whole + 1)

    def run(deviation: Vector) -> Vector:
        x, y, theta, dv, domega, *moved = deviation[:queue_at].tolist()
        state = State(*at.in_world(0.0, x, y, theta), v + dv, omega + domega, 0.0, 0.0)
        torques = deque(
            (steady[0] + r, steady[1] + left)
            for r, left in deviation[queue_at:size].reshape(-1, 2).tolist()
        )
        fix = at.in_world(-late_s, *deviation[size:].tolist())
        fast = tuple(map(add, element.steady, moved))
        pose = (x, y, theta)
        for n in range(periods):
            t = n * h
            if n == tick:
                pose = at.in_path(t, state.x, state.y, state.theta)
            s = s_dot * t
            motion = RobotMotion(*fix, state.v, state.omega)
            along = PathVariable(s, s_dot, 0.0)
            right, left, fast = element.step(fast, motion, path(s), along)
            torques.append((right, left))
            if part > 0.0:
                state = _moved(loop.body, state, torques[0], part * h)
            state = _moved(loop.body, state, torques[1], (1.0 - part) * h)
            torques.popleft()
        end = at.in_path(periods * h, state.x, state.y, state.theta)
        moved = [value - rest for value, rest in zip(fast, element.steady, strict=True)]
        queue = [value - s for pair in torques for value, s in zip(pair, steady, strict=True)]
        return np.array([*end, state.v - v, state.omega - omega, *moved, *queue, *pose])

    nudges = _NUDGE * np.eye(size + 3)
    return np.array([(run(nudge) - run(-nudge)) / (2.0 * _NUDGE) for nudge in nudges]).T


def _moved(body: RigidBody, state: State, torques: tuple[float, float], span_s: float) -> State:
    after = rk4(body, state, torques[0], torques[1], 0.0, span_s)
    return state if after is None else after


class _Frame:
    """The reference's own axes, which move along an arc."""

    def __init__(self, v: float, omega: float) -> None:
        self._v, self._omega = v, omega

    def _origin(self, t_s: float) -> tuple[float, float, float]:
        angle = self._omega * t_s
        if abs(angle) < 1e-9:
            return self._v * t_s, 0.0, angle
        radius = self._v / self._omega
        return radius * sin(angle), radius * (1.0 - cos(angle)), angle

    def path(self, v_bar: float, omega_bar: float, s_dot: float) -> RobotPath:
        """The arc by s, at this ṡ > 0."""
        return lambda s: Reference(*self.in_world(s / s_dot, 0.0, 0.0, 0.0), v_bar, omega_bar)

    def in_world(self, t_s: float, x: float, y: float, theta: float) -> tuple[float, float, float]:
        x_0, y_0, angle = self._origin(t_s)
        c, s = cos(angle), sin(angle)
        return x_0 + c * x - s * y, y_0 + s * x + c * y, angle + theta

    def in_path(self, t_s: float, x: float, y: float, theta: float) -> tuple[float, float, float]:
        x_0, y_0, angle = self._origin(t_s)
        c, s = cos(angle), sin(angle)
        dx, dy = x - x_0, y - y_0
        return c * dx + s * dy, c * dy - s * dx, theta - angle


def pole_time_s(radius: float, period_s: float) -> float:
    """Time constant of the slowest motion."""
    return float("inf") if radius >= 1.0 else -period_s / float(np.log(max(radius, 1e-12)))
