"""The trapezoidal trajectory of input mode TRAP_TRAJ: bounded speed and acceleration.

    v(t) = v_0 + a t              0 ≤ t < T_a            to the cruising speed v_c              (1)
    v(t) = v_c                    T_a ≤ t < T_a + T_v                                           (2)
    v(t) = −d (T − t)             T_a + T_v ≤ t < T      to rest at the goal                    (3)

    a, d  signed accelerations [rev/s²]   T = T_a + T_v + T_d

The direction is the side of the goal on which braking at once would end. Two things are unlike the
vendor's planner, which misses the goal in these cases where both limits differ: an axis faster
than v_c brakes with d, and one that moves the wrong way turns with the smaller of both. A move too
short for the cruising speed turns at the speed where accelerating meets braking,

    v_c² = (d v_0² + 2 a d Δx) / (d − a)                                                        (4)
"""

from math import copysign, sqrt
from typing import NamedTuple


class Point(NamedTuple):
    """A point of a trajectory."""

    position: float  # [rev]
    velocity: float  # [rev/s]
    acceleration: float  # [rev/s²]


class Trapezoid(NamedTuple):
    """One move."""

    start: float
    start_velocity: float
    goal: float
    cruise: float  # v_c
    accel: float  # a
    decel: float  # d
    accel_s: float
    cruise_s: float
    decel_s: float

    @property
    def duration_s(self) -> float:
        """T."""
        return self.accel_s + self.cruise_s + self.decel_s

    def point_at(self, t_s: float) -> Point:
        """The point at a time from the start; at rest in the goal from T on."""
        if t_s < self.accel_s:
            velocity = self.start_velocity + self.accel * t_s
            position = self.start + 0.5 * (self.start_velocity + velocity) * t_s
            return Point(position, velocity, self.accel)
        if t_s < self.accel_s + self.cruise_s:
            reached = self.start + 0.5 * (self.start_velocity + self.cruise) * self.accel_s
            return Point(reached + self.cruise * (t_s - self.accel_s), self.cruise, 0.0)
        left_s = t_s - self.duration_s
        if left_s >= 0.0:
            return Point(self.goal, 0.0, 0.0)
        return Point(
            self.goal + 0.5 * self.decel * left_s * left_s, self.decel * left_s, self.decel
        )


def plan(
    start: float, start_velocity: float, goal: float, limits: tuple[float, float, float]
) -> Trapezoid | None:
    """The move within limits (speed [rev/s], acceleration, deceleration [rev/s²]).

    None if a limit is 0.
    """
    speed, accel, decel = limits
    if min(limits) <= 0.0:
        return None
    distance = goal - start
    stopping = copysign(start_velocity * start_velocity / (2.0 * decel), start_velocity)
    sign = 1.0 if distance >= stopping else -1.0
    if sign * start_velocity < 0.0:
        accel = min(accel, decel)
    a, d, cruise = sign * accel, -sign * decel, sign * speed
    too_fast = sign * start_velocity > speed
    if too_fast:
        a = d
    accel_s, decel_s = (cruise - start_velocity) / a, speed / decel
    least = 0.5 * accel_s * (cruise + start_velocity) + 0.5 * decel_s * cruise
    if too_fast or sign * distance >= sign * least:
        cruise_s = max((distance - least) / cruise, 0.0)
    else:
        square = (d * start_velocity * start_velocity + 2.0 * a * d * distance) / (d - a)
        cruise = sign * sqrt(max(square, 0.0))
        accel_s, cruise_s = max((cruise - start_velocity) / a, 0.0), 0.0
        decel_s = max(-cruise / d, 0.0)
    return Trapezoid(start, start_velocity, goal, cruise, a, d, accel_s, cruise_s, decel_s)
