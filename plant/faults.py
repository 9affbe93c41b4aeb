"""Faults of the plant: what acts on the robots of one bus, tick by tick.

EFFECTS        of faults that last: their part of the robot's effects (`plant.effects`), which are
               made anew of all that act on it when one begins or ends
STRIKES        of faults that are an instant: what they do to the robot, once

Those of faults of frames and CAN controllers are in `plant.disturbance`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import hypot
from typing import Any, Final

from bridge.fault_schedule import FaultSchedule
from configs.brief import Schedule
from configs.events import Event
from configs.faults.base import PlannedFault
from configs.ticks import Ticks
from plant.disturbance import Disturbances
from plant.effects import PoseDrift, RobotEffects, WheelEffects, of_side
from plant.robot import EmulatedRobot

Effect = Callable[[RobotEffects, Any, int], None]
"""Adds a fault, of its kind's class, that began at a scenario time [ns]."""
Strike = Callable[[EmulatedRobot, Any, int], None]
"""Lets a fault, of its kind's class, strike a robot at a bus time [ns]."""


def _each_wheel(effect: Callable[[WheelEffects, Any], None]) -> Effect:
    """The effect of a `WheelFault`, of its effect on one wheel."""

    def of_robot(effects: RobotEffects, fault: Any, _: int) -> None:
        for wheel in of_side((effects.right, effects.left), fault.wheel):
            effect(wheel, fault)

    return of_robot


# --- powertrains ----------------------------------------------------------------------------------


@_each_wheel
def _torque_half(wheel: WheelEffects, _: Any) -> None:
    wheel.torque_factor *= 0.5


@_each_wheel
def _torque_reversed(wheel: WheelEffects, _: Any) -> None:
    wheel.torque_factor *= -1.0


@_each_wheel
def _torque_stuck(wheel: WheelEffects, _: Any) -> None:
    wheel.torque_stuck = True


@_each_wheel
def _torque_zero(wheel: WheelEffects, _: Any) -> None:
    wheel.torque_zero = True


@_each_wheel
def _fet_over_temperature(wheel: WheelEffects, fault: Any) -> None:
    wheel.fet_rise_K += fault.rise_K


@_each_wheel
def _motor_over_temperature(wheel: WheelEffects, fault: Any) -> None:
    wheel.motor_rise_K += fault.rise_K


def _voltage(effects: RobotEffects, fault: Any, _: int) -> None:
    effects.supply_V = fault.voltage_V


@_each_wheel
def _encoder_freeze(wheel: WheelEffects, _: Any) -> None:
    wheel.encoder_frozen = True


@_each_wheel
def _encoder_sign_flip(wheel: WheelEffects, _: Any) -> None:
    wheel.encoder_flipped = not wheel.encoder_flipped


@_each_wheel
def _encoder_noise(wheel: WheelEffects, fault: Any) -> None:
    wheel.encoder_noise_counts = hypot(wheel.encoder_noise_counts, fault.counts_rms)


@_each_wheel
def _encoder_slip(wheel: WheelEffects, fault: Any) -> None:
    wheel.encoder_kept *= 1.0 - fault.share


def _encoder_jump(robot: EmulatedRobot, fault: Any, _: int) -> None:
    for encoder in of_side(robot.encoders, fault.wheel):
        encoder.jump(fault.shaft_rev)


# --- drives ---------------------------------------------------------------------------------------


def _drive_estop(robot: EmulatedRobot, fault: Any, _: int) -> None:
    for drive in of_side(robot.drives, fault.wheel):
        drive.estop()


def _drive_watchdog(robot: EmulatedRobot, fault: Any, _: int) -> None:
    for drive in of_side(robot.drives, fault.wheel):
        drive.expire_watchdog()


def _drive_reboot(robot: EmulatedRobot, fault: Any, bus_ns: int) -> None:
    for drive in of_side(robot.drives, fault.wheel):
        drive.reboot(bus_ns)


def _drive_error(robot: EmulatedRobot, fault: Any, _: int) -> None:
    for drive in of_side(robot.drives, fault.wheel):
        drive.trip(fault.error)


# --- bodies ---------------------------------------------------------------------------------------


def _push(effects: RobotEffects, fault: Any, _: int) -> None:
    effects.force_body_N += fault.force_body_N
    effects.torque_body_N_m += fault.torque_body_N_m


def _payload(effects: RobotEffects, fault: Any, _: int) -> None:
    effects.mass_kg += fault.mass_kg
    effects.inertia_kg_m2 += fault.inertia_kg_m2
    effects.com_offset_m += fault.com_offset_m


@_each_wheel
def _friction(wheel: WheelEffects, fault: Any) -> None:
    wheel.friction_factor *= fault.factor


def _wheel_radius(effects: RobotEffects, fault: Any, _: int) -> None:
    effects.radius_factor *= fault.factor


@_each_wheel
def _wheel_slip(wheel: WheelEffects, fault: Any) -> None:
    wheel.rolled *= 1.0 - fault.ratio


# --- localisation ---------------------------------------------------------------------------------


def _localisation_bias(effects: RobotEffects, fault: Any, _: int) -> None:
    x, y, theta = effects.pose
    effects.pose = x + fault.x_m, y + fault.y_m, theta + fault.theta_rad


def _localisation_drift(effects: RobotEffects, fault: Any, begun_ns: int) -> None:
    effects.drifts.append(PoseDrift(begun_ns, fault.x_m_s, fault.y_m_s, fault.theta_rad_s))


def _localisation_jump(robot: EmulatedRobot, fault: Any, _: int) -> None:
    robot.jump_pose(fault.x_m, fault.y_m, fault.theta_rad)


EFFECTS: Final[Mapping[str, Effect]] = {
    "torque_stuck": _torque_stuck,
    "torque_half": _torque_half,
    "torque_zero": _torque_zero,
    "torque_reversed": _torque_reversed,
    "fet_over_temperature": _fet_over_temperature,
    "motor_over_temperature": _motor_over_temperature,
    "under_voltage": _voltage,
    "over_voltage": _voltage,
    "encoder_freeze": _encoder_freeze,
    "encoder_sign_flip": _encoder_sign_flip,
    "encoder_noise": _encoder_noise,
    "encoder_slip": _encoder_slip,
    "push": _push,
    "payload": _payload,
    "friction": _friction,
    "wheel_radius": _wheel_radius,
    "wheel_slip": _wheel_slip,
    "localisation_bias": _localisation_bias,
    "localisation_drift": _localisation_drift,
}
"""By kind."""
STRIKES: Final[Mapping[str, Strike]] = {
    "drive_estop": _drive_estop,
    "drive_watchdog": _drive_watchdog,
    "drive_reboot": _drive_reboot,
    "drive_error": _drive_error,
    "encoder_jump": _encoder_jump,
    "localisation_jump": _localisation_jump,
}
"""By kind."""


class BusFaults:
    """The faults of the robots on one bus."""

    __slots__ = ("_period_ns", "_robots", "_ticks", "disturbances", "note", "schedule", "struck")

    def __init__(
        self, planned: Iterable[PlannedFault], robots: Sequence[EmulatedRobot], ticks: Schedule
    ) -> None:
        self._robots = {robot.brief.robot: robot for robot in robots}
        self._ticks, self._period_ns = Ticks(ticks), ticks.period_ns
        self.disturbances = Disturbances(robots)
        """Faults of the bus itself: of its frames and CAN controllers."""
        self.schedule = FaultSchedule(one for one in planned if one.target in self._robots)
        self.note: Callable[[Event], None] = lambda _: None
        """Called with the event of each that begins or ends."""
        self.struck: Callable[[], None] = lambda: None
        """Called when something has struck: drives may be due at other times than they said."""

    def begin(self, tick: int) -> None:
        """Let the faults of a tick act, bodies being where they are at that instant."""
        if tick >= self.schedule.next_tick:
            self._change(tick)

    def _change(self, tick: int) -> None:
        changes = self.schedule.due(tick)
        for change in changes:
            self.note(change.event)
        lasting = [c.planned.target for c in changes if c.planned.fault.kind in EFFECTS]
        for name in dict.fromkeys(lasting):
            effects = RobotEffects()
            for planned in self.schedule.acting:
                if planned.target == name and planned.fault.kind in EFFECTS:
                    begun_ns = planned.from_tick * self._period_ns
                    EFFECTS[planned.fault.kind](effects, planned.fault, begun_ns)
            self._robots[name].apply(effects)
        strikes = [c.planned for c in changes if c.planned.fault.kind in STRIKES]
        for planned in strikes:
            strike, robot = STRIKES[planned.fault.kind], self._robots[planned.target]
            strike(robot, planned.fault, self._ticks.bus_time_ns(tick))
        if strikes:
            self.struck()
        self.disturbances.follow(self.schedule.acting, changes)
