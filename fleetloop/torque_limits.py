"""What limits the torque of a robot's wheels, at the wheel: law, host and drives.

the law's limit, if any       control.torque_limit_wheel_N_m
the host's                    host.torque_limit_wheel_N_m
gear × k_t × i_max            drive.torque_constant_N_m_A, current_limit_A, and [motor]'s
gear × k_v (v_max − gear ν)   the drive's velocity limit, of its torque mode                 (1)
gear × k_t × (U − k_t ω_s)/R  supply.voltage_V at the shaft's speed ω_s                      (2)
"""

from dataclasses import dataclass
from math import inf, pi, sqrt

from configs.scenario import Scenario
from configs.sections import Robot
from fleetloop.law_facts import torque_limit_wheel_N_m

_MODULATION = sqrt(3.0) / 2.0


@dataclass(frozen=True, slots=True)
class Limit:
    """A bound of a wheel's torque: at standstill, less a slope times the wheel's speed."""

    key: str
    words: str
    torque_wheel_N_m: float
    slope_wheel_N_m_s: float = 0.0
    speed_m_s: float = inf
    """Robot's speed straight on at which nothing is left."""


def limits(scenario: Scenario, robot: Robot) -> list[Limit]:
    """All that bounds a wheel's torque."""
    control, host, drive = scenario.control_of(robot), scenario.host, scenario.drive
    found = []
    own_N_m = torque_limit_wheel_N_m(control)
    if own_N_m < inf:
        found.append(Limit("control.torque_limit_wheel_N_m", "the law's limit", own_N_m))
    if host.torque_limit_wheel_N_m is not None:
        found.append(
            Limit("host.torque_limit_wheel_N_m", "the host's limit", host.torque_limit_wheel_N_m)
        )
    if drive.preset != "ideal":
        found += _drive_limits(scenario, robot)
    return found


def tightest(scenario: Scenario, robot: Robot) -> Limit | None:
    """The least bound of a wheel's torque at standstill; None: nothing bounds it."""
    found = limits(scenario, robot)
    return min(found, key=lambda one: one.torque_wheel_N_m) if found else None


def _drive_limits(scenario: Scenario, robot: Robot) -> list[Limit]:
    drive, motor = scenario.drive, scenario.motor
    gear = scenario.mounting_of(robot).gear_ratio
    radius_m = scenario.body_of(robot).wheel_radius_m
    constant, current = drive.torque_constant_N_m_A, drive.current_limit_A
    key, limit_A = "drive.current_limit_A", current
    if drive.preset == "realistic":
        constant = motor.torque_constant_N_m_A or constant
        if motor.current_limit_A is not None and motor.current_limit_A < current:
            key, limit_A = "motor.current_limit_A", motor.current_limit_A
    words = f"gear {gear:g} × {constant:g} N·m/A × {limit_A:g} A"
    per_rad = 1.0 / (2.0 * pi)
    found = [Limit(key, words, gear * constant * limit_A)]
    velocity = drive.velocity_limit()
    if velocity is not None:
        fastest, gain = velocity.limit_shaft_rev_s, velocity.gain_shaft_N_m_s_rev
        found.append(
            Limit(
                velocity.key,
                f"what the drive's velocity limit of {fastest:g} rev/s leaves",
                gear * gain * fastest,
                gear**2 * gain * per_rad,
                fastest * 2.0 * pi / gear * radius_m,
            )
        )
    if drive.preset == "realistic":
        resistance = motor.winding_resistance_ohm + motor.fet_resistance_ohm
        most = _MODULATION * scenario.supply.voltage_V
        found.append(
            Limit(
                "supply.voltage_V",
                f"what {scenario.supply.voltage_V:g} V leave beside the motor's own voltage",
                gear * constant * most / resistance,
                gear**2 * constant**2 / resistance,
                most / constant / gear * radius_m,
            )
        )
    return found
