"""What a drive measures beside its encoder."""

from typing import NamedTuple


class Feeling(NamedTuple):
    """What a drive measures of its motor and of the supply."""

    torque_shaft_N_m: float  # the motor's, estimated
    current_A: float  # q axis
    fet_C: float
    motor_C: float  # NaN: no thermistor
    bus_V: float
    bus_A: float
