"""The emulated ODrive axis: what a drive does between two frames. Firmware 0.6.

    state         on                                         to            torque
    IDLE          Set_Axis_State 8, no error, calibrated     CLOSED_LOOP   0
    IDLE          Set_Axis_State 8, an active error          IDLE          0   result DISARMED
    IDLE          Set_Axis_State 8, not calibrated           IDLE          0   result NOT_CALIBRATED
    IDLE          Set_Axis_State 3, 4, 6, 7                  calibrating   0   result BUSY
    calibrating   its time has passed                        IDLE          0   result SUCCESS
    calibrating   Set_Axis_State 1                           IDLE          0   result CANCELLED
    IDLE          Set_Axis_State of another procedure        IDLE          0   result INVALID_STATE
    IDLE          Reboot                                     IDLE          0   back to power-up
    IDLE          Reboot 3, Enter_DFU_Mode                   silent        0   until power-up
    CLOSED_LOOP   Set_Axis_State 1                           IDLE          `control`'s
    any           Estop, watchdog, overspeed, heat, bus      IDLE          `control`'s
                  voltage, an input that isn't finite

Errors stay until Clear_Errors; the heartbeat says active errors or the reason of the last disarm.
A disarmed drive coasts. What the field knows and hosts must live with is kept: without a watchdog
the last torque acts for ever; a torque sent while idle is stored and acts on arming (unless
`zero_torque_on_disarm`); velocity and position set-points overwrite the torque by their
feed-forward field; any host may command. Frames of other nodes, 29-bit and error frames, unknown
commands and the drive's own messages are ignored; so is a remote frame where data is expected. The
watchdog is fed by set-points and by arming. An axis without address (0x3F) answers a query after a
random delay, so that several of them can be told apart.
"""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from random import Random

from bridge.drives.feeling import Feeling
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.control import REFUSED_MODES, Control
from bridge.drives.odrive.cyclic import NEVER, Cyclic, after
from bridge.drives.odrive.endpoints import answer
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ControlMode, InputMode
from bridge.drives.odrive.frames import ProcedureResult as Result
from bridge.drives.odrive.parameters import parameters
from bridge.drives.odrive.readings import Readings, floats
from bridge.frame import EFF, ERR, RTR, Frame
from configs.brief import DriveModel

_NONE: Sequence[Frame] = ()
_CLOSED_LOOP = AxisState.CLOSED_LOOP_CONTROL
_HARDWARE = (2, 4, 4, 58)  # protocol, hardware line, version, variant
_CONFIRMING_FIRMWARE = (0, 6, 11)
"""From this version on, writes of SDO are answered."""
_CALIBRATION_NS = {
    AxisState.FULL_CALIBRATION_SEQUENCE: 2_500_000_000,
    AxisState.MOTOR_CALIBRATION: 1_000_000_000,
    AxisState.ENCODER_INDEX_SEARCH: 1_000_000_000,
    AxisState.ENCODER_OFFSET_CALIBRATION: 1_500_000_000,
}
_ANSWER_WITHIN_NS = 100_000_000
_MAX_TORQUE_N_M = 3.4e38
_UNPACK_FLOAT = f.ONE_FLOAT.unpack
_PACK_TWO = f.TWO_FLOATS.pack
_new = tuple.__new__  # of a frame, past its constructor: this is the hot path
_MEASURED = (
    Command.GET_IQ,
    Command.GET_TEMPERATURE,
    Command.GET_BUS_VOLTAGE_CURRENT,
    Command.GET_TORQUES,
    Command.GET_POWERS,
)


class OdriveNode:
    """One axis on the bus. Told the time, never asks for it."""

    def __init__(self, model: DriveModel, node_id: int, serial_number: int) -> None:
        self._model = model
        self._serial = serial_number
        self._delivered_id = node_id
        self._random = Random(serial_number)
        self._handlers = self._table()
        self._start(node_id)

    def _start(self, node_id: int) -> None:
        """Power-up state."""
        model = self._model
        self.state = AxisState.IDLE
        self.errors = AxisError(0)
        self.disarm_reason = AxisError(0)
        self.result = Result.SUCCESS
        self.calibrated = model.calibrated
        self.silent = False
        """In its boot loader: hears and says nothing."""
        self.ignored = 0
        self.fed_ns = 0
        self.watchdog_ns = model.watchdog_ns
        self.encoder_period_ns = model.encoder_period_ns
        self.control = Control(model)
        self._readings = Readings(model.torque_constant_N_m_A)
        self._cyclic = Cyclic(
            {
                Command.HEARTBEAT: model.heartbeat_period_ns,
                Command.GET_ERROR: model.error_period_ns,
                Command.GET_IQ: model.iq_period_ns,
                Command.GET_TEMPERATURE: model.temperature_period_ns,
                Command.GET_BUS_VOLTAGE_CURRENT: model.bus_period_ns,
                Command.GET_TORQUES: model.torques_period_ns,
                Command.GET_POWERS: model.powers_period_ns,
            }
        )
        self._offset = 0.0
        self._calibrated_ns = self._address_ns = self._procedures_ns = NEVER
        self._limited = model.torque_limiters
        self._next_encoder_ns = 0 if self.encoder_period_ns else NEVER
        self._endpoints = parameters(self, self.control, self._cyclic, self._readings)
        self.readdress(node_id)

    # --- the plant's end -------------------------------------------------------------------------

    @property
    def input_torque(self) -> float:
        """The torque that the last set-point said [N·m], before limits."""
        return self.control.input_torque

    def feed(self, revolutions: float, rev_s: float) -> None:
        """Take what the encoder says: position [rev] and speed [rev/s] of the shaft."""
        readings = self._readings
        readings.position = revolutions + self._offset
        readings.velocity = rev_s

    def feel(self, feeling: Feeling) -> None:
        """Take what the drive measures of its motor and supply."""
        self._readings.feel(feeling)
        if self._readings.errors and self.state is not AxisState.IDLE:
            self._disarm(self._readings.errors)

    def torque_demand(self, dt_s: float) -> float:
        """Torque that the drive asks of its motor for the next `dt_s` [N·m]; always finite."""
        if self.state is not _CLOSED_LOOP:
            return 0.0
        control = self.control
        if control.plain:
            return control.input_torque
        readings = self._readings
        return control.demand(dt_s, readings.position, readings.velocity, readings.derating)

    @property
    def next_due_ns(self) -> int:
        """The earliest bus time at which `due` has something to do; after the last call of it."""
        if self.silent:
            return NEVER
        next_ns = min(self._next_encoder_ns, self._cyclic.next_ns)
        if self.state is _CLOSED_LOOP and self.watchdog_ns:
            next_ns = min(next_ns, self.fed_ns + self.watchdog_ns + 1)
        return min(next_ns, self._procedures_ns)

    def due(self, now_ns: int) -> Sequence[Frame]:
        """Cyclic frames due at this instant, after a look at what disarms."""
        if self.state is _CLOSED_LOOP and (
            self._limited or now_ns - self.fed_ns > self.watchdog_ns
        ):
            self._supervise(now_ns)
        encoder = now_ns >= self._next_encoder_ns
        if now_ns >= self._cyclic.next_ns or now_ns >= self._procedures_ns:
            return self._due(now_ns, encoder=encoder)
        if not encoder:
            return _NONE
        period_ns = self.encoder_period_ns
        self._next_encoder_ns = (now_ns // period_ns + 1) * period_ns
        return (self._encoder_estimates(),)

    def feedback(self, now_ns: int) -> Frame:
        """The encoder frame out of its turn; the next cyclic one comes a period later."""
        self._next_encoder_ns = now_ns + 2 * self.encoder_period_ns
        return self._encoder_estimates()

    def hear(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Take one frame from the bus; return the replies."""
        can_id, data = frame
        if can_id == self.setpoint_id and len(data) == 4:
            (torque,) = _UNPACK_FLOAT(data)
            if isfinite(torque) and not self.silent:
                self.fed_ns = now_ns
                self.control.input_torque = torque
                return _NONE
        if can_id & (EFF | ERR) or self.silent or not self._is_mine(can_id):
            return _NONE
        handler = self._handlers.get(can_id & 0x1F)
        if handler is None:
            self.ignored += 1
            return _NONE
        return handler(frame, now_ns)

    # --- what it does ----------------------------------------------------------------------------

    def _is_mine(self, can_id: int) -> bool:
        node = (can_id & 0x7FF) >> f.BITS
        return node == self.node_id or (node == f.UNADDRESSED and can_id & 0x1F == Command.ADDRESS)

    def _due(self, now_ns: int, *, encoder: bool) -> Sequence[Frame]:
        if self.silent:
            return _NONE
        frames = []
        if now_ns >= self._calibrated_ns:
            self._calibrated_ns = NEVER
            self.calibrated, self.result, self.state = True, Result.SUCCESS, AxisState.IDLE
        if now_ns >= self._address_ns:
            self._address_ns = NEVER
            frames.append(self._address())
        self._procedures_ns = min(self._calibrated_ns, self._address_ns)
        said = self._cyclic.take(now_ns) if now_ns >= self._cyclic.next_ns else ()
        for command in said:
            if encoder and command > Command.GET_ENCODER_ESTIMATES:
                frames.append(self._encoder_estimates())
                self._next_encoder_ns = after(now_ns, self.encoder_period_ns)
                encoder = False
            frames.append(self._say(command))
        if encoder:
            frames.append(self._encoder_estimates())
            self._next_encoder_ns = after(now_ns, self.encoder_period_ns)
        return frames

    def _supervise(self, now_ns: int) -> None:
        if self.watchdog_ns and now_ns - self.fed_ns > self.watchdog_ns:
            self._disarm(AxisError.WATCHDOG_TIMER_EXPIRED)
        control = self.control
        overspeed = self._model.overspeed_ratio * control.velocity_limit
        if control.limiters and abs(self._readings.velocity) > overspeed:
            self._disarm(AxisError.VELOCITY_LIMIT_VIOLATION)

    def _disarm(self, error: AxisError) -> None:
        self.errors |= error
        if self.state is not AxisState.IDLE:
            self.disarm_reason = error
            self.result = Result.DISARMED
            self._to_idle()

    def _to_idle(self) -> None:
        self.state = AxisState.IDLE
        self._calibrated_ns, self._procedures_ns = NEVER, self._address_ns
        if self._model.zero_torque_on_disarm:
            self.control.input_torque = 0.0

    def _arm(self, now_ns: int) -> None:
        self.errors |= self._readings.errors
        blocking = self.errors
        if not self._model.estop_blocks_arming:
            blocking &= ~AxisError.ESTOP_REQUESTED
        if self.state is _CLOSED_LOOP:
            return
        if blocking:
            self.result = Result.DISARMED
        elif not self.calibrated:
            self.result = Result.NOT_CALIBRATED
        else:
            self.result = Result.SUCCESS
            self.state = AxisState.CLOSED_LOOP_CONTROL
            self.fed_ns = now_ns
            self.control.reset(self._readings.position, self._readings.velocity)

    def readdress(self, node: int) -> None:
        """Take a node id, 0 to 62, or 63 for none; any other is ignored."""
        if 0 <= node <= f.UNADDRESSED:
            self.node_id = node
            self._encoder_id = f.identifier(node, Command.GET_ENCODER_ESTIMATES)
            self.setpoint_id = f.identifier(node, Command.SET_INPUT_TORQUE)

    def set_encoder_period(self, period_ns: int) -> None:
        """Change the rate of the encoder's frames; 0 stops them."""
        self.encoder_period_ns = max(period_ns, 0)
        self._next_encoder_ns = 0 if self.encoder_period_ns else NEVER

    # --- what it is told -------------------------------------------------------------------------

    def _table(self) -> Mapping[int, Callable[[Frame, int], Sequence[Frame]]]:
        return {
            Command.RX_SDO: self._on_sdo,
            Command.ADDRESS: self._on_address,
            Command.ESTOP: self._on_estop,
            Command.CLEAR_ERRORS: self._on_clear_errors,
            Command.SET_AXIS_STATE: self._setter(self._on_axis_state),
            Command.SET_CONTROLLER_MODE: self._setter(self._on_controller_mode),
            Command.SET_INPUT_POS: self._setter(self._on_input_pos),
            Command.SET_INPUT_VEL: self._setter(self._on_input_vel),
            Command.SET_INPUT_TORQUE: self._setter(self._on_input_torque),
            Command.SET_LIMITS: self._setter(self._two("velocity_limit", "current_limit")),
            Command.SET_TRAJ_VEL_LIMIT: self._setter(self._one("trajectory_velocity")),
            Command.SET_TRAJ_ACCEL_LIMITS: self._setter(self._two("accel_limit", "decel_limit")),
            Command.SET_TRAJ_INERTIA: self._setter(self._one("inertia")),
            Command.SET_POS_GAIN: self._setter(self._one("position_gain")),
            Command.SET_VEL_GAINS: self._setter(
                self._two("velocity_gain", "velocity_integrator_gain")
            ),
            Command.SET_ABSOLUTE_POSITION: self._setter(self._on_absolute_position),
            Command.REBOOT: self._setter(self._on_reboot),
            Command.ENTER_DFU_MODE: self._setter(self._on_dfu),
            **{
                command: self._answer(command)
                for command in (
                    Command.GET_VERSION,
                    Command.HEARTBEAT,
                    Command.GET_ERROR,
                    Command.GET_ENCODER_ESTIMATES,
                    *_MEASURED,
                )
            },
        }

    def _answer(self, command: Command) -> Callable[[Frame, int], Sequence[Frame]]:
        """A Get: answered when asked; anything else on its identifier is somebody's imitation."""

        def handle(frame: Frame, _: int) -> Sequence[Frame]:
            if f.is_request(frame):
                return (self._say(command),)
            self.ignored += 1
            return _NONE

        return handle

    def _setter(self, act: Callable[[bytes, int], None]) -> Callable[[Frame, int], Sequence[Frame]]:
        """A Set: a remote frame carries nothing to set and is ignored."""

        def handle(frame: Frame, now_ns: int) -> Sequence[Frame]:
            if frame.can_id & RTR:
                self.ignored += 1
            else:
                act(frame.data, now_ns)
            return _NONE

        return handle

    def _one(self, attribute: str) -> Callable[[bytes, int], None]:
        def act(data: bytes, _: int) -> None:
            self._set_control({attribute: f.decode_float(data)})

        return act

    def _two(self, first: str, second: str) -> Callable[[bytes, int], None]:
        def act(data: bytes, _: int) -> None:
            values = f.decode_floats(data)
            self._set_control({first: values[0], second: values[1]})

        return act

    def _set_control(self, values: Mapping[str, float]) -> None:
        """Limits and gains: all of a message or, if one of them makes no sense, none."""
        if all(value >= 0.0 for value in values.values()):  # False for NaN
            for attribute, value in values.items():
                setattr(self.control, attribute, min(value, _MAX_TORQUE_N_M))
        else:
            self.ignored += 1

    def _on_estop(self, frame: Frame, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        self._disarm(AxisError.ESTOP_REQUESTED)
        return _NONE

    def _on_clear_errors(self, frame: Frame, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        self.errors = self.disarm_reason = AxisError(0)
        return _NONE

    def _on_axis_state(self, data: bytes, now_ns: int) -> None:
        (asked,) = f.ONE_U32.unpack(f.padded(data, 4))
        if asked == AxisState.CLOSED_LOOP_CONTROL:
            self._arm(now_ns)
        elif asked == AxisState.IDLE:
            calibrating = self._calibrated_ns != NEVER
            self.result = Result.CANCELLED if calibrating else Result.SUCCESS
            self._to_idle()
        elif asked == AxisState.STARTUP_SEQUENCE and self.state is AxisState.IDLE:
            self.result = Result.SUCCESS  # nothing is configured to happen
        elif asked in _CALIBRATION_NS and self.state is AxisState.IDLE and not self.errors:
            self.state, self.result = AxisState(asked), Result.BUSY
            self._calibrated_ns = now_ns + _CALIBRATION_NS[self.state]
            self._procedures_ns = min(self._calibrated_ns, self._address_ns)
        elif asked in _CALIBRATION_NS and self.state is AxisState.IDLE:
            self.result = Result.DISARMED
        else:
            self.result = Result.INVALID_STATE
            self._to_idle()

    def _on_controller_mode(self, data: bytes, _: int) -> None:
        control, mode = f.TWO_U32.unpack(f.padded(data, 8))
        try:
            modes = ControlMode(control), InputMode(mode)
        except ValueError:
            self._disarm(AxisError.BAD_CONFIG)
            return
        if modes[0] is ControlMode.VOLTAGE or modes[1] in REFUSED_MODES:
            self._disarm(AxisError.BAD_CONFIG)
        else:
            self.control.set_modes(*modes)

    def _on_input_torque(self, data: bytes, now_ns: int) -> None:
        self._set_inputs(now_ns, torque=f.decode_float(data))

    def _on_input_vel(self, data: bytes, now_ns: int) -> None:
        velocity, torque = f.decode_floats(data)
        self._set_inputs(now_ns, torque=torque, velocity=velocity)

    def _on_input_pos(self, data: bytes, now_ns: int) -> None:
        position, velocity, torque = f.INPUT_POS.unpack(f.padded(data, 8))
        self._set_inputs(now_ns, torque=torque * 1e-3, velocity=velocity * 1e-3, position=position)

    def _set_inputs(
        self,
        now_ns: int,
        *,
        torque: float,
        velocity: float | None = None,
        position: float | None = None,
    ) -> None:
        """Take a set-point: what isn't a number disarms, what is infinite saturates."""
        self.fed_ns = now_ns
        control = self.control
        values = [torque, *(v for v in (velocity, position) if v is not None)]
        unlimited = not control.limiters and not all(isfinite(value) for value in values)
        if unlimited or any(value != value for value in values):
            control.input_torque = 0.0
            control.input_velocity = 0.0
            self._disarm(AxisError.BAD_CONFIG)
            return
        control.input_torque = _saturated(torque)
        if velocity is not None:
            control.input_velocity = _saturated(velocity)
        if position is not None:
            control.input_position = _saturated(position)
            control.arrived = control.input_mode is not InputMode.TRAP_TRAJ

    def _on_absolute_position(self, data: bytes, _: int) -> None:
        position = f.decode_float(data)
        if isfinite(position):
            self._offset += position - self._readings.position
            self._readings.position = position

    def _on_reboot(self, data: bytes, now_ns: int) -> None:
        """0 reboot, 1 save and reboot, 2 erase and reboot, 3 boot loader; only when idle."""
        action = f.padded(data, 1)[0]
        if self.state is not AxisState.IDLE or action > 3:
            self.ignored += 1
        elif action == 3:
            self.silent = True
        else:
            # Saved are the address and the rates of messages; erasing brings back the delivery.
            periods, encoder_ns = dict(self._cyclic.periods_ns), self.encoder_period_ns
            self._start(self._delivered_id if action == 2 else self.node_id)
            if action == 1:
                self._cyclic.periods_ns.update(periods)
                self.encoder_period_ns = encoder_ns
            self._cyclic.restart(now_ns)
            self._next_encoder_ns = now_ns if self.encoder_period_ns else NEVER

    def _on_dfu(self, _data: bytes, _now_ns: int) -> None:
        if self.state is AxisState.IDLE:
            self.silent = True
        else:
            self.ignored += 1

    def _on_sdo(self, frame: Frame, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        confirms = self._model.firmware >= _CONFIRMING_FIRMWARE
        reply = None
        if not frame.can_id & RTR:
            reply = answer(self._endpoints, frame.data, confirms_writes=confirms)
        if reply is None:
            self.ignored += 1
            return _NONE
        return (self._frame(Command.TX_SDO, reply),)

    def _on_address(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        data = frame.data
        if f.is_request(frame):
            if self.node_id != f.UNADDRESSED:
                return (self._address(),)
            self._address_ns = now_ns + 1 + self._random.randrange(_ANSWER_WITHIN_NS)
            self._procedures_ns = min(self._calibrated_ns, self._address_ns)
            return _NONE
        if len(data) < 7:
            self.ignored += 1
            return _NONE
        node, serial = data[0], int.from_bytes(data[1:7], "little")
        if serial in (0, self._serial):
            self.readdress(node)
        elif node == self.node_id:
            self.readdress(f.UNADDRESSED)
        return _NONE

    # --- what it says ----------------------------------------------------------------------------

    def _frame(self, command: Command, data: bytes) -> Frame:
        return Frame(f.identifier(self.node_id, command), data)

    def _say(self, command: Command) -> Frame:
        match command:
            case Command.HEARTBEAT:
                errors = self.errors | self.disarm_reason
                done = int(self.control.arrived and self.control.input_mode is InputMode.TRAP_TRAJ)
                data = f.HEARTBEAT.pack(errors, self.state, self.result, done, 0)
            case Command.GET_VERSION:
                data = f.VERSION.pack(*_HARDWARE, *self._model.firmware, 0)
            case Command.GET_ERROR:
                data = f.TWO_U32.pack(self.errors, self.disarm_reason)
            case Command.GET_ENCODER_ESTIMATES:
                return self._encoder_estimates()
            case _:
                data = self._readings.data(command, self.torque_demand(0.0))
        return self._frame(command, data)

    def _encoder_estimates(self) -> Frame:
        readings = self._readings
        try:
            data = _PACK_TWO(readings.position, readings.velocity)
        except OverflowError:  # a robot that diverges
            data = floats(readings.position, readings.velocity)
        return _new(Frame, (self._encoder_id, data))

    def _address(self) -> Frame:
        data = bytes((self.node_id,)) + self._serial.to_bytes(6, "little") + b"\0"
        return self._frame(Command.ADDRESS, data)


def _saturated(value: float) -> float:
    return min(max(value, -_MAX_TORQUE_N_M), _MAX_TORQUE_N_M)
