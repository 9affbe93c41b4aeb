"""Calibration procedures: their steps, durations and results.

    asked                        runs
    FULL_CALIBRATION_SEQUENCE    MOTOR_CALIBRATION, then ENCODER_OFFSET_CALIBRATION
    MOTOR_CALIBRATION            itself
    ENCODER_INDEX_SEARCH         itself; needs a calibrated motor
    ENCODER_OFFSET_CALIBRATION   itself; needs a calibrated motor

Each takes the same time. What it finds out is a parameter: saved by Reboot 1, else gone on reboot.
"""

from typing import Final

from bridge.drives.odrive.frames import AxisState
from bridge.drives.odrive.parameters import Parameters

NEVER: Final = 1 << 61
_PROCEDURES: Final = {
    AxisState.FULL_CALIBRATION_SEQUENCE: (
        AxisState.MOTOR_CALIBRATION,
        AxisState.ENCODER_OFFSET_CALIBRATION,
    ),
    AxisState.MOTOR_CALIBRATION: (AxisState.MOTOR_CALIBRATION,),
    AxisState.ENCODER_INDEX_SEARCH: (AxisState.ENCODER_INDEX_SEARCH,),
    AxisState.ENCODER_OFFSET_CALIBRATION: (AxisState.ENCODER_OFFSET_CALIBRATION,),
}


class Calibration:
    """The procedures of one axis."""

    __slots__ = ("_duration_ns", "_procedures", "ends_ns")

    def __init__(self, duration_ns: int) -> None:
        self._duration_ns = duration_ns
        self.cancel()

    def cancel(self) -> None:
        """Stop whatever runs."""
        self._procedures: tuple[AxisState, ...] = ()
        self.ends_ns = NEVER
        """Bus time of the end of the running procedure."""

    @property
    def runs(self) -> bool:
        """Whether a procedure is under way."""
        return bool(self._procedures)

    @property
    def state(self) -> AxisState:
        """The reported state of the axis."""
        return self._procedures[0] if self._procedures else AxisState.IDLE

    def begin(self, asked: int, parameters: Parameters, now_ns: int) -> bool:
        """Start; False if the motor has to be calibrated first."""
        procedures = _PROCEDURES[AxisState(asked)]
        if procedures[0] is not AxisState.MOTOR_CALIBRATION and not parameters.motor_calibrated:
            return False
        self._procedures = procedures
        self.ends_ns = now_ns + self._duration_ns
        return True

    def end(self, parameters: Parameters) -> None:
        """The procedure is over; go on to the next one."""
        ended, *rest = self._procedures
        if ended is AxisState.MOTOR_CALIBRATION:
            parameters.motor_calibrated = True
        elif ended is AxisState.ENCODER_OFFSET_CALIBRATION:
            parameters.encoder_calibrated = True
        self._procedures = tuple(rest)
        self.ends_ns = self.ends_ns + self._duration_ns if rest else NEVER


def exists(asked: int) -> bool:
    """Whether there is such a procedure."""
    return asked in _PROCEDURES
