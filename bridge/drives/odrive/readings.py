"""What an axis measures, as data of its messages; what follows from temperature and voltage.

    derating   1 up to 100 °C of FETs or windings, falling to 0 at 120 °C
    errors     INVERTER_OVER_TEMP, MOTOR_OVER_TEMP at 125 °C; DC_BUS_UNDER_VOLTAGE below 10 V,
               DC_BUS_OVER_VOLTAGE above 30 V

Without a feeling (an ideal motor) the axis reads room temperature, 24 V, and what it asks for.
"""

from math import isnan, pi

from bridge.drives.feeling import Feeling
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, Command

DERATE_FROM_C, DERATE_TO_C, TRIP_C = 100.0, 120.0, 125.0
UNDER_VOLTAGE_V, OVER_VOLTAGE_V = 10.0, 30.0
_ROOM_C = 25.0
_BUS_V = 24.0
_FLOAT32_MAX = 3.4e38


class Readings:
    """The sensors of one axis."""

    __slots__ = ("_constant", "derating", "errors", "feeling", "position", "velocity")

    def __init__(self, torque_constant: float) -> None:
        self._constant = torque_constant
        self.position = self.velocity = 0.0
        """Of the shaft [rev], [rev/s]."""
        self.feeling: Feeling | None = None
        self.derating = 1.0
        self.errors = AxisError(0)
        """What can't be armed with, and disarms."""

    def feel(self, feeling: Feeling) -> None:
        """Take a reading of motor and supply."""
        self.feeling = feeling
        fet, motor = feeling.fet_C, feeling.motor_C
        hottest = fet if isnan(motor) else max(fet, motor)
        span = DERATE_TO_C - DERATE_FROM_C
        self.derating = min(max((DERATE_TO_C - hottest) / span, 0.0), 1.0)
        errors = AxisError(0)
        if fet > TRIP_C:
            errors |= AxisError.INVERTER_OVER_TEMP
        if motor > TRIP_C:
            errors |= AxisError.MOTOR_OVER_TEMP
        if feeling.bus_V < UNDER_VOLTAGE_V:
            errors |= AxisError.DC_BUS_UNDER_VOLTAGE
        elif feeling.bus_V > OVER_VOLTAGE_V:
            errors |= AxisError.DC_BUS_OVER_VOLTAGE
        self.errors = errors

    def data(self, command: Command, target_N_m: float) -> bytes:
        """The data of a measured message; `target_N_m` is what the axis asks of its motor."""
        feeling = self.feeling
        match command:
            case Command.GET_IQ:
                asked = target_N_m / self._constant
                return floats(asked, asked if feeling is None else feeling.current_A)
            case Command.GET_TEMPERATURE:
                if feeling is None:
                    return f.TWO_FLOATS.pack(_ROOM_C, _ROOM_C)
                return f.TWO_FLOATS.pack(feeling.fet_C, feeling.motor_C)
            case Command.GET_BUS_VOLTAGE_CURRENT:
                if feeling is None:
                    return floats(_BUS_V, self.mechanical_W(target_N_m) / _BUS_V)
                return floats(feeling.bus_V, feeling.bus_A)
            case Command.GET_TORQUES:
                return floats(target_N_m, target_N_m if feeling is None else feeling.torque_N_m)
            case Command.GET_POWERS:
                if feeling is None:
                    watts = self.mechanical_W(target_N_m)
                    return floats(watts, watts)
                mechanical = self.mechanical_W(feeling.torque_N_m)
                return floats(feeling.bus_V * feeling.bus_A, mechanical)
            case _:
                raise ValueError(f"{command.name} isn't measured")

    def mechanical_W(self, torque_N_m: float) -> float:  # noqa: N802 - the unit
        """Power at the shaft."""
        return torque_N_m * self.velocity * 2.0 * pi


def floats(first: float, second: float) -> bytes:
    """Two floats for the wire, clamped to what a single can hold."""
    limit = _FLOAT32_MAX
    return f.TWO_FLOATS.pack(min(max(first, -limit), limit), min(max(second, -limit), limit))
