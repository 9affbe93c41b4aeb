"""The emulated drive of the test's protocol: it makes the torque of its last set-point."""

from collections.abc import Sequence

from support.second_drive.tools import (
    ENCODER,
    ERRORS,
    MOTION,
    REV,
    REV_S,
    SET_POINT,
    TORQUE,
    PlainSection,
)

from bridge.drives.interface import DriveMeasurements
from bridge.frame import Frame
from configs.brief import DriveModel


class PlainNode:
    """One drive."""

    def __init__(self, model: DriveModel, node_id: int, serial_number: int) -> None:  # noqa: ARG002
        assert isinstance(model.section, PlainSection)
        self._unit = model.section.torque_unit_shaft_N_m
        self._id = MOTION + node_id
        self.setpoint_id = TORQUE + node_id
        self._period_ns = model.encoder_period_ns
        self.next_due_ns = 0
        self.fed_ns = self.ignored = 0
        self.input_torque_shaft = 0.0
        self._motion = (0.0, 0.0)
        self.off = ""
        """The reason why it makes no torque until it boots anew, "" if it does."""

    def update_encoder(self, revolutions: float, rev_s: float) -> None:
        self._motion = (revolutions, rev_s)

    def lose_estimate(self) -> None:
        self.input_torque_shaft = 0.0

    def due(self, now_ns: int) -> Sequence[Frame]:
        if now_ns < self.next_due_ns:
            return ()
        self.next_due_ns = (now_ns // self._period_ns + 1) * self._period_ns
        return (self.feedback(now_ns),)

    def feedback(self, now_ns: int) -> Frame:  # noqa: ARG002
        rev, rev_s = self._motion
        return Frame(self._id, ENCODER.pack(round(rev / REV), round(rev_s / REV_S)))

    def on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        if frame.can_id == self.setpoint_id and len(frame.data) != SET_POINT.size:
            self.ignored += 1
        elif frame.can_id == self.setpoint_id:
            (steps,) = SET_POINT.unpack(frame.data)
            self.input_torque_shaft = steps * self._unit
            self.fed_ns = now_ns
        return ()

    @property
    def state_in_words(self) -> str:
        return f"OFF: {self.off}" if self.off else "ON"

    def update_measurements(self, measurements: DriveMeasurements) -> None:
        pass

    def torque_demand_shaft(self, dt_s: float) -> float:  # noqa: ARG002
        return 0.0 if self.off else self.input_torque_shaft

    def estop(self) -> None:
        self.off = "stopped"

    def expire_watchdog(self) -> None:
        raise AssertionError("it has none, and its section says so")

    def reboot(self, now_ns: int) -> None:  # noqa: ARG002
        self.off = ""
        self.input_torque_shaft = 0.0

    def trip(self, error: str | None) -> None:
        self.off = error or ERRORS[0]
