"""Section [drive] of a scenario whose drives are ODrives, and its relations to other sections."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge

from bridge.drives.odrive.frames import AxisError
from configs import patterns
from configs.drives import Derating, Drive, VelocityLimit
from configs.errors import Problem
from configs.parameters import (
    Finite,
    NotNegative,
    Pattern,
    Positive,
    Seconds,
    SecondsOrZero,
    parameter,
)

if TYPE_CHECKING:
    from configs.host import Host
    from configs.sections import Clock

UNLIMITED = 1e6
"""A limit that nothing reaches: [A], [rev/s]."""
_ERRORS = tuple(
    dict.fromkeys(
        str(error.name)
        for error in (AxisError.DRV_FAULT, *AxisError)
        if error is not AxisError.INITIALIZING
    )
)
_WHOLE_MILLISECONDS = (
    "heartbeat_period_s",
    "encoder_period_s",
    "torques_period_s",
    "error_period_s",
    "iq_period_s",
    "temperature_period_s",
    "bus_voltage_period_s",
    "powers_period_s",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class OdriveSection(Drive):
    """The ODrives, two per robot."""

    heartbeat_period_s: Seconds = 0.1
    torques_period_s: SecondsOrZero = parameter(
        0.0, "this message and the next five: whole milliseconds; 0: only on request"
    )
    error_period_s: SecondsOrZero = 0.0
    iq_period_s: SecondsOrZero = 0.0
    temperature_period_s: SecondsOrZero = 0.0
    bus_voltage_period_s: SecondsOrZero = 0.0
    powers_period_s: SecondsOrZero = 0.0
    firmware: Annotated[str, Pattern(patterns.FIRMWARE)] = parameter(
        "0.6.10", "from 0.6.11 on, writing an endpoint is answered"
    )
    boot_s: SecondsOrZero = parameter(0.5, "silent for so long after a reboot")
    calibrated: bool = parameter(True, "at power-up; else arming needs a calibration")
    calibration_s: Seconds = parameter(2.0, "of the motor, and then of the encoder")
    estop_blocks_arming: bool = parameter(True, "until errors are cleared")
    under_voltage_V: NotNegative = parameter(10.0, "of the bus; below, a drive disarms")
    over_voltage_V: Positive = parameter(30.0, "of the bus; above, a drive disarms")
    derate_from_C: Finite = parameter(100.0, "from here the current limit falls linearly")
    derate_to_C: Finite = parameter(120.0, "to nothing here; 5 K above, a drive disarms")
    spinout_power_W: NotNegative = parameter(
        10.0, "disarms if the motor brakes and takes more than this; 0: it never does"
    )
    watchdog_s: SecondsOrZero = parameter(0.1, "0: off, as drives are delivered")
    zero_torque_on_disarm: bool = parameter(False, "False: as in the field")
    velocity_limit_shaft_rev_s: Positive = 10.0
    velocity_gain_shaft_N_m_s_rev: Positive = 1.0 / 6.0
    velocity_integrator_gain_shaft_N_m_rev: NotNegative = 1.0 / 3.0
    position_gain_1_s: NotNegative = 20.0
    overspeed_ratio: Annotated[float, Ge(1)] = 1.2

    def limits(self, *, limited: bool) -> tuple[float, float]:
        """(velocity limit [rev/s], current limit [A]) of a drive; not `limited`: none."""
        if not limited:
            return UNLIMITED, UNLIMITED
        return self.velocity_limit_shaft_rev_s, self.current_limit_A

    def velocity_limit(self) -> VelocityLimit:
        """The torque mode's: its velocity controller bounds the torque."""
        return VelocityLimit(
            "drive.velocity_limit_shaft_rev_s",
            self.velocity_limit_shaft_rev_s,
            self.velocity_gain_shaft_N_m_s_rev,
        )

    def derating(self) -> Derating:
        """Of both thermistors."""
        return Derating(self.derate_from_C, self.derate_to_C)

    def errors(self) -> tuple[str, ...]:
        """Names of `AxisError`, that of the gate driver first."""
        return _ERRORS

    def fault_problem(self, kind: str) -> str | None:
        """A watchdog that is off never expires."""
        if kind == "drive_watchdog" and not self.watchdog_s:
            return "drives have no watchdog: needs drive.watchdog_s above 0"
        return None

    def problems(self, clock: "Clock", host: "Host") -> Iterator[Problem]:
        """Problems of these keys with each other, with [clock] and with [host]."""
        for key in _WHOLE_MILLISECONDS:
            period_s = getattr(self, key) or 0.0
            if abs(period_s * 1e3 - round(period_s * 1e3)) > 1e-6:
                yield Problem(f"drive.{key}", period_s, "whole milliseconds, as drives have them")
        if self.under_voltage_V >= self.over_voltage_V:
            above = f"must be below drive.over_voltage_V = {self.over_voltage_V:g}"
            yield Problem("drive.under_voltage_V", self.under_voltage_V, above)
        if self.derate_from_C >= self.derate_to_C:
            above = f"must be below drive.derate_to_C = {self.derate_to_C:g}"
            yield Problem("drive.derate_from_C", self.derate_from_C, above)
        if self.watchdog_s and self.watchdog_s < 2 * clock.control_period_s:
            yield Problem(
                "drive.watchdog_s",
                self.watchdog_s,
                "0 (off) or at least two control periods, or every torque comes too late",
            )
        yield from self._heartbeats(clock, host)

    def _heartbeats(self, clock: "Clock", host: "Host") -> Iterator[Problem]:
        """What waits for heartbeats waits long enough."""
        heartbeat_s = self.heartbeat_period_s
        shortest_s = 3 * clock.control_period_s + 2 * heartbeat_s
        if clock.countdown_s < shortest_s:
            yield Problem(
                "clock.countdown_s",
                clock.countdown_s,
                "too short to arm the drives: three control periods and two of"
                f" drive.heartbeat_period_s need {shortest_s:g} s or more",
            )
        least = {"heartbeat_age_limit_s": (2, "two")}
        if host.rearm:
            least |= {"rearm_after_s": (2, "two"), "rearm_limit_s": (3, "three")}
        for key, (count, word) in least.items():
            value_s, limit_s = getattr(host, key), count * heartbeat_s
            if value_s < limit_s:
                what = f"{word} of drive.heartbeat_period_s, {limit_s:g} s, or more"
                remedy = f"{what}, or a healthy robot stops or never arms"
                yield Problem(f"host.{key}", value_s, remedy)
