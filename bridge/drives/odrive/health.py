"""Derating and disarming by a drive's measurements.

    measured                                    consequence
    FET or motor between θ_1 and θ_2            current limit × (θ_2 − θ) / (θ_2 − θ_1)         (1)
    FET above θ_2 + 5 K                         INVERTER_OVER_TEMP
    motor above θ_2 + 5 K                       MOTOR_OVER_TEMP; no thermistor (NaN): not looked at
    FET not a number                            THERMISTOR_DISCONNECTED, current limit 0
    bus below, above its limits, not a number   DC_BUS_UNDER_VOLTAGE, DC_BUS_OVER_VOLTAGE
    |i_q| above the limit in force + margin     CURRENT_LIMIT_VIOLATION
    P_mechanical < −P_s and P_electrical > P_s  SPINOUT_DETECTED

Powers are low-passed with 20 rad/s. Both thermistors derate alike. Source: ODrive firmware 0.5.6,
thermistor.cpp, motor.cpp, controller.cpp; names of the errors are 0.6's.
"""

from math import exp, pi
from typing import Final

from bridge.drives.interface import DriveMeasurements
from bridge.drives.odrive.frames import AxisError
from bridge.drives.odrive.model import AxisModel

TRIP_K: Final = 5.0
_POWER_BANDWIDTH_RAD_S: Final = 20.0


class Thresholds:
    """What measurements are compared with: numbers of a drive's model."""

    __slots__ = (
        *("current_margin_A", "derate_from_C", "derate_to_C", "over_voltage_V"),
        *("under_voltage_V",),
    )

    def __init__(self, model: AxisModel) -> None:
        self.derate_from_C = model.derate_from_C
        self.derate_to_C = model.derate_to_C
        self.under_voltage_V = model.under_voltage_V
        self.over_voltage_V = model.over_voltage_V
        self.current_margin_A = model.current_margin_A


def derating(celsius: float, thresholds: Thresholds) -> float:
    """The factor on the current limit by (1), in [0, 1]; 0 for NaN."""
    from_C, to_C = thresholds.derate_from_C, thresholds.derate_to_C
    if not celsius < to_C:
        return 0.0
    return 1.0 if celsius <= from_C else (to_C - celsius) / (to_C - from_C)


def current_limit(measurements: DriveMeasurements, limit_A: float, thresholds: Thresholds) -> float:
    """The current limit in force [A]."""
    factor = derating(measurements.fet_C, thresholds)
    if measurements.motor_C == measurements.motor_C:
        factor = min(factor, derating(measurements.motor_C, thresholds))
    return limit_A * factor


def conditions(
    measurements: DriveMeasurements, limit_in_force_A: float, thresholds: Thresholds
) -> int:
    """The conditions that disarm the drive now, as bits of `AxisError`."""
    hottest_C = thresholds.derate_to_C + TRIP_K
    bits = 0
    if measurements.fet_C != measurements.fet_C:
        bits |= AxisError.THERMISTOR_DISCONNECTED.value
    elif measurements.fet_C >= hottest_C:
        bits |= AxisError.INVERTER_OVER_TEMP.value
    if measurements.motor_C >= hottest_C:
        bits |= AxisError.MOTOR_OVER_TEMP.value
    if not measurements.bus_V >= thresholds.under_voltage_V:
        bits |= AxisError.DC_BUS_UNDER_VOLTAGE.value
    elif measurements.bus_V > thresholds.over_voltage_V:
        bits |= AxisError.DC_BUS_OVER_VOLTAGE.value
    if not abs(measurements.current_A) <= limit_in_force_A + thresholds.current_margin_A:
        bits |= AxisError.CURRENT_LIMIT_VIOLATION.value
    return bits


class SpinoutDetector:
    """The motor brakes while it takes power: the encoder isn't where it was calibrated."""

    __slots__ = ("_electrical_W", "_mechanical_W", "_threshold_W")

    def __init__(self, threshold_W: float) -> None:
        self._threshold_W = threshold_W
        self.reset()

    def reset(self) -> None:
        """Forget the past: what arming does."""
        self._electrical_W = self._mechanical_W = 0.0

    def detects(self, measurements: DriveMeasurements, velocity_rev_s: float, dt_s: float) -> bool:
        """Update by the measurements over `dt_s`."""
        keep = exp(-_POWER_BANDWIDTH_RAD_S * dt_s)
        mechanical = measurements.torque_shaft_N_m * velocity_rev_s * 2.0 * pi
        electrical = measurements.bus_V * measurements.bus_A
        self._mechanical_W = mechanical + keep * (self._mechanical_W - mechanical)
        self._electrical_W = electrical + keep * (self._electrical_W - electrical)
        if not self._threshold_W > 0.0:
            return False
        return self._mechanical_W < -self._threshold_W < self._threshold_W < self._electrical_W
