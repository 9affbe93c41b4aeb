"""The emulated axis behind the messages: its states, disarming, and its torque demand.

    state         on                                          to            result
    IDLE          CLOSED_LOOP asked                           CLOSED_LOOP   SUCCESS
    IDLE          the same, errors active or modes unknown    IDLE          DISARMED
    IDLE          the same, motor or encoder not calibrated   IDLE          NOT_CALIBRATED
    IDLE          calibration asked (3, 4, 6, 7)              calibrating   BUSY
    calibrating   its time is over                            IDLE          SUCCESS
    calibrating   IDLE asked                                  IDLE          CANCELLED
    any           HOMING asked                                IDLE          HOMING_WITHOUT_ENDSTOP
    any           a procedure asked that isn't emulated       IDLE          INVALID_STATE
    CLOSED_LOOP   IDLE asked                                  IDLE          SUCCESS
    not IDLE      e-stop, watchdog, overspeed, bad input,     IDLE          DISARMED
                  or what `health` finds

Errors stay until cleared, and what caused them raises them again. Only CLOSED_LOOP makes torque;
calibration takes its time and turns nothing. Asking for CLOSED_LOOP in CLOSED_LOOP and asking for
state 0 change nothing.

Kept as the field has it: without a watchdog the last torque acts for ever; inputs sent while idle
are stored and act on arming (position inputs don't: arming begins where the axis is), unless
`zero_torque_on_disarm`. The watchdog is fed by set-points and by arming. Firmware 0.6; where its
documentation is silent, 0.5.6's source.
"""

from math import inf, isfinite
from typing import Final

from bridge.drives.interface import DriveMeasurements, DriveNode
from bridge.drives.odrive import calibration, control, health
from bridge.drives.odrive.calibration import NEVER, Calibration
from bridge.drives.odrive.control import Controller
from bridge.drives.odrive.frames import AxisError, AxisState, ControlMode, InputMode
from bridge.drives.odrive.frames import ProcedureResult as Result
from bridge.drives.odrive.model import AxisModel
from bridge.drives.odrive.parameters import FLOAT32_MAX, Parameters

_CLOSED_LOOP: Final = AxisState.CLOSED_LOOP_CONTROL


class LocalAxis(DriveNode):
    """One axis. Pure: the time is an argument."""

    __slots__ = (
        "_conditions",
        "_fastest_rev_s",
        "_lasting",
        "_offset",
        "_plain",
        "_silence_ns",
        "_spinout",
        "_thresholds",
        "_torque_limit",
        "_unmeasured_s",
        "calibration",
        "controller",
        "demand",
        "disarm_reason",
        "errors",
        "fed_ns",
        "input_torque_shaft",
        "measurements",
        "model",
        "parameters",
        "position",
        "result",
        "serial",
        "state",
        "velocity",
    )

    def __init__(self, model: AxisModel, serial: int) -> None:
        self.model = model
        self.serial = serial
        self._thresholds = health.Thresholds(model)
        self._lasting = AxisError(0)  # never cleared

    def power_up(self, parameters: Parameters) -> None:
        """Idle, without errors, with these parameters."""
        self.parameters = parameters
        self.controller = Controller(parameters)
        self.state = AxisState.IDLE
        self.errors, self.disarm_reason = self._lasting, AxisError(0)
        self.result = Result.SUCCESS
        self.input_torque_shaft = self.demand = 0.0
        self.position = self.velocity = self._offset = 0.0
        self.measurements: DriveMeasurements | None = None
        self.fed_ns = 0
        self._conditions = 0
        self._unmeasured_s = 0.0
        self._spinout = health.SpinoutDetector(self.model.spinout_power_W)
        self.calibration = Calibration(self.model.calibration_ns)
        self.apply()

    def apply(self) -> None:
        """Apply changed parameters."""
        p = self.parameters
        armed = self.state is _CLOSED_LOOP
        limiters = self.model.torque_limiters
        watched = armed and p.watchdog_enabled
        self._silence_ns = min(round(p.watchdog_s * 1e9), NEVER) if watched else NEVER
        self._plain = (
            not limiters
            and p.control_mode == ControlMode.TORQUE
            and p.input_mode == InputMode.PASSTHROUGH
        )
        self._fastest_rev_s = self.model.overspeed_ratio * p.velocity_limit if limiters else inf
        limit_A = p.current_limit
        if self.measurements is not None:
            limit_A = health.current_limit(self.measurements, limit_A, self._thresholds)
        self._torque_limit = limit_A * self.model.torque_constant_N_m_A if limiters else None
        if armed and not control.exists(p.control_mode, p.input_mode):
            self.disarm(AxisError.BAD_CONFIG)

    # --- the plant's end -------------------------------------------------------------------------

    def update_encoder(self, revolutions: float, rev_s: float) -> None:
        """Set the encoder's position [rev] and speed [rev/s] of the shaft."""
        self.position = revolutions + self._offset
        self.velocity = rev_s

    def lose_estimate(self) -> None:
        """The encoder's estimate is gone for good: disarm with that error, which nothing clears."""
        self._lasting = AxisError.MISSING_ESTIMATE
        self.disarm(self._lasting)

    def update_measurements(self, measurements: DriveMeasurements) -> None:
        """Set the drive's measurements; derate, and disarm at a condition of `health`."""
        self.measurements = measurements
        thresholds = self._thresholds
        limit_A = health.current_limit(measurements, self.parameters.current_limit, thresholds)
        if self._torque_limit is not None:
            self._torque_limit = limit_A * self.model.torque_constant_N_m_A
        armed = self.state is _CLOSED_LOOP
        if armed and self._spinout.detects(measurements, self.velocity, self._unmeasured_s):
            self.disarm(AxisError.SPINOUT_DETECTED)
        self._unmeasured_s = 0.0
        found = health.conditions(measurements, limit_A, thresholds)
        raised = found & ~self._conditions
        self._conditions = found
        if raised:
            self.disarm(AxisError(raised))

    def torque_demand_shaft(self, dt_s: float = 0.0) -> float:
        """Torque asked of the motor for the next `dt_s` [N·m]; always finite, 0 unless armed."""
        if self.state is not _CLOSED_LOOP:
            return 0.0
        if self._plain:
            return self.input_torque_shaft
        self._check_motion()
        if self.state is not _CLOSED_LOOP:
            return 0.0
        self._unmeasured_s += dt_s
        motion = self.position, self.velocity
        torque = self.controller.step(dt_s, self.input_torque_shaft, motion, self._torque_limit)
        if not -FLOAT32_MAX <= torque <= FLOAT32_MAX:
            self.disarm(AxisError.BAD_CONFIG)
            return 0.0
        self.demand = torque
        return torque

    @property
    def effective_torque_shaft(self) -> float:
        """The present torque demand [N·m], without a step of the controller."""
        if self._plain and self.state is _CLOSED_LOOP:
            return self.input_torque_shaft
        return self.demand

    # --- supervision -----------------------------------------------------------------------------

    def supervise(self, now_ns: int) -> None:
        """Check the watchdog, the running procedure and the motion."""
        if now_ns - self.fed_ns > self._silence_ns:
            self.disarm(AxisError.WATCHDOG_TIMER_EXPIRED)
        while now_ns >= self.calibration.ends_ns:
            self.calibration.end(self.parameters)
            self.state = self.calibration.state
            if self.state is AxisState.IDLE:
                self.result = Result.SUCCESS
        if self.state is _CLOSED_LOOP and not self._plain:
            self._check_motion()

    def disarm(self, error: AxisError) -> None:
        """Raise an error and go to IDLE."""
        self.errors |= error
        if self.state is not AxisState.IDLE:
            self.disarm_reason = error
            self.result = Result.DISARMED
            self._to_idle()

    def estop(self) -> None:
        """Go to IDLE; `estop_blocks_arming` decides whether arming then needs Clear_Errors."""
        if self.model.estop_blocks_arming:
            self.errors |= AxisError.ESTOP_REQUESTED
        self.disarm_reason |= AxisError.ESTOP_REQUESTED
        if self.state is not AxisState.IDLE:
            self.result = Result.DISARMED
            self._to_idle()

    def expire_watchdog(self) -> None:
        """Disarm as when the watchdog wasn't fed."""
        self.disarm(AxisError.WATCHDOG_TIMER_EXPIRED)

    def trip(self, error: str | None) -> None:
        """Disarm with an error of this name; None: the first of the section's."""
        self.disarm(AxisError[error or self.model.errors()[0]])

    def clear_errors(self) -> None:
        """Clear errors but those whose cause is still measured."""
        self.errors = AxisError(self._conditions) | self._lasting
        self.disarm_reason = AxisError(0)

    def _check_motion(self) -> None:
        if not isfinite(self.position + self.velocity):
            self.disarm(AxisError.MISSING_ESTIMATE)
        elif abs(self.velocity) > self._fastest_rev_s:
            self.disarm(AxisError.VELOCITY_LIMIT_VIOLATION)

    # --- commands ----------------------------------------------------------------------------

    def set_torque(self, torque: float, now_ns: int) -> None:
        """Set the torque input [N·m]. NaN disarms, and so does ∞ where nothing limits it."""
        if torque != torque or not (self.model.torque_limiters or isfinite(torque)):
            self.input_torque_shaft = 0.0
            self.disarm(AxisError.BAD_CONFIG)
            return
        self.fed_ns = now_ns
        self.input_torque_shaft = min(max(torque, -FLOAT32_MAX), FLOAT32_MAX)

    def set_velocity(self, velocity: float, torque: float, now_ns: int) -> None:
        """Set the velocity input [rev/s] and its feed-forward, the torque input."""
        if velocity != velocity:
            torque = velocity
        else:
            self.controller.input_velocity = min(max(velocity, -FLOAT32_MAX), FLOAT32_MAX)
        self.set_torque(torque, now_ns)

    def set_position(self, position: float, velocity: float, torque: float, now_ns: int) -> None:
        """Set the position input [rev] and its feed-forwards, the other inputs."""
        if position != position:
            torque = position
        else:
            self.controller.move_to(min(max(position, -FLOAT32_MAX), FLOAT32_MAX))
        self.set_velocity(velocity, torque, now_ns)

    def set_modes(self, control_mode: int, input_mode: int) -> None:
        """Set control and input mode. Unknown modes disarm: at once, or on arming."""
        p = self.parameters
        if (control_mode, input_mode) != (p.control_mode, p.input_mode):
            p.control_mode, p.input_mode = control_mode, input_mode
            self.controller.reset(self.position)
            self.apply()

    def move_origin(self, position: float) -> bool:
        """Set the present position to `position` [rev]; False if either is not finite."""
        if not isfinite(position) or not isfinite(self.position):
            return False
        self._offset += position - self.position
        self.position = position
        return True

    def request(self, asked: int, now_ns: int) -> None:
        """Request a state; see the table above."""
        if asked == AxisState.UNDEFINED:
            return
        if asked == AxisState.CLOSED_LOOP_CONTROL == self.state:
            return
        calibrating = self.calibration.runs
        self._to_idle()
        match asked:
            case AxisState.IDLE:
                self.result = Result.CANCELLED if calibrating else Result.SUCCESS
            case AxisState.STARTUP_SEQUENCE:
                self.result = Result.SUCCESS
            case AxisState.HOMING:
                self.result = Result.HOMING_WITHOUT_ENDSTOP
            case AxisState.CLOSED_LOOP_CONTROL:
                self._arm(now_ns)
            case _ if calibration.exists(asked):
                self._calibrate(asked, now_ns)
            case _:
                self.result = Result.INVALID_STATE

    def _arm(self, now_ns: int) -> None:
        p = self.parameters
        if not control.exists(p.control_mode, p.input_mode):
            self.errors |= AxisError.BAD_CONFIG
        if self.errors:
            self.result = Result.DISARMED
        elif not (p.motor_calibrated and p.encoder_calibrated):
            self.result = Result.NOT_CALIBRATED
        else:
            self.result = Result.SUCCESS
            self.disarm_reason = AxisError(0)
            self.state = AxisState.CLOSED_LOOP_CONTROL
            self.fed_ns = now_ns
            self._unmeasured_s = 0.0
            self._spinout.reset()
            self.controller.reset(self.position)
            self.apply()

    def _calibrate(self, asked: int, now_ns: int) -> None:
        if self.errors:
            self.result = Result.DISARMED
        elif not self.calibration.begin(asked, self.parameters, now_ns):
            self.result = Result.NOT_CALIBRATED
        else:
            self.result = Result.BUSY
            self.state = self.calibration.state

    def _to_idle(self) -> None:
        self.state = AxisState.IDLE
        self.demand = 0.0
        self._silence_ns = NEVER
        self.calibration.cancel()
        if self.model.zero_torque_on_disarm:
            self.input_torque_shaft = self.controller.input_velocity = 0.0
