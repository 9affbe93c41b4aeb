"""The emulated ODrive axis: what a drive does between two frames. Firmware 0.6, torque mode.

    state         on                                         to            torque
    IDLE          Set_Axis_State 8, no active error          CLOSED_LOOP   0
    IDLE          Set_Axis_State 8, active error             IDLE          0   result DISARMED
    IDLE          Set_Axis_State of another procedure        IDLE          0   result INVALID_STATE
    IDLE          Reboot                                     IDLE          0   back to power-up
    CLOSED_LOOP   Set_Axis_State 1                           IDLE          input torque, limited
    CLOSED_LOOP   Estop, watchdog, overspeed, bad input      IDLE          input torque, limited

Errors stay until Clear_Errors; the heartbeat says active errors or the reason of the last disarm.
A disarmed drive coasts. What the field knows and hosts must live with is kept: without a watchdog
the last torque acts for ever; a torque sent while idle is stored and acts on arming (unless
`zero_torque_on_disarm`); velocity and position set-points overwrite the torque by their
feed-forward field; any host may command. A set-point that isn't finite disarms. Frames of other
nodes, 29-bit and error frames, unknown commands and the drive's own messages are ignored. The
watchdog is fed by set-points and by arming.
"""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ControlMode, InputMode
from bridge.drives.odrive.frames import ProcedureResult as Result
from bridge.frame import EFF, ERR, RTR, Frame
from configs.brief import DriveModel

_NONE: Sequence[Frame] = ()
_HARDWARE = (2, 4, 4, 58, 0, 6, 10, 0)  # protocol, hardware line, version, variant, firmware
_UNPACK_FLOAT = f.ONE_FLOAT.unpack
_PACK_TWO = f.TWO_FLOATS.pack
_new = tuple.__new__  # of a frame, past its constructor: this is the hot path
_TEMPERATURE_C = 25.0
_BUS_V = 24.0


class OdriveNode:
    """One axis on the bus. Told the time, never asks for it."""

    def __init__(self, model: DriveModel, node_id: int, serial_number: int) -> None:
        self._model = model
        self._serial = serial_number
        self._handlers = self._table()
        self._start(node_id)

    def _start(self, node_id: int) -> None:
        """Power-up state."""
        model = self._model
        self.node_id = node_id
        self.state = AxisState.IDLE
        self.errors = AxisError(0)
        self.disarm_reason = AxisError(0)
        self.result = Result.SUCCESS
        self.input_torque = 0.0
        self.ignored = 0
        self._control_mode = ControlMode.TORQUE
        self._input_mode = InputMode.PASSTHROUGH
        self._velocity_limit = model.velocity_limit_rev_s
        self._current_limit = model.current_limit_A
        self._position = self._velocity = 0.0
        self._offset = 0.0
        self.fed_ns = 0
        self._next_heartbeat_ns = self._next_encoder_ns = self._next_torques_ns = 0
        self._next_other_ns = 0
        self._encoder_id = f.identifier(node_id, Command.GET_ENCODER_ESTIMATES)
        self.setpoint_id = f.identifier(node_id, Command.SET_INPUT_TORQUE)

    # --- the plant's end -------------------------------------------------------------------------

    def feed(self, revolutions: float, rev_s: float) -> None:
        """Take what the encoder says: position [rev] and speed [rev/s] of the shaft."""
        self._position = revolutions + self._offset
        self._velocity = rev_s

    def torque_demand(self, dt_s: float = 0.0) -> float:  # noqa: ARG002
        """Torque that the drive asks of its motor now [N·m]; always finite."""
        if self.state is not AxisState.CLOSED_LOOP_CONTROL:
            return 0.0
        model = self._model
        if not model.torque_limiters:
            return self.input_torque
        torque = self.input_torque
        gain = model.velocity_gain_N_m_s_rev
        torque = min(torque, (self._velocity_limit - self._velocity) * gain)
        torque = max(torque, (-self._velocity_limit - self._velocity) * gain)
        limit = self._current_limit * model.torque_constant_N_m_A
        return min(max(torque, -limit), limit)

    @property
    def next_due_ns(self) -> int:
        """The earliest bus time at which `due` has something to do."""
        return min(self._next_encoder_ns, self._next_other_ns)

    def feel(self, feeling: object) -> None:
        """Take what the drive measures."""

    def due(self, now_ns: int) -> Sequence[Frame]:
        """Cyclic frames due at this instant; the watchdog is looked at first."""
        self._supervise(now_ns)
        encoder = now_ns >= self._next_encoder_ns
        if now_ns < self._next_other_ns:
            if not encoder:
                return _NONE
            self._next_encoder_ns = _after(now_ns, self._model.encoder_period_ns)
            return (self._encoder_estimates(),)
        model = self._model
        frames = []
        if now_ns >= self._next_heartbeat_ns:
            self._next_heartbeat_ns = _after(now_ns, model.heartbeat_period_ns)
            frames.append(self._heartbeat())
        if encoder:
            self._next_encoder_ns = _after(now_ns, model.encoder_period_ns)
            frames.append(self._encoder_estimates())
        if model.torques_period_ns and now_ns >= self._next_torques_ns:
            self._next_torques_ns = _after(now_ns, model.torques_period_ns)
            frames.append(self._torques())
        others = [self._next_heartbeat_ns]
        if model.torques_period_ns:
            others.append(self._next_torques_ns)
        self._next_other_ns = min(others)
        return frames

    def feedback(self, now_ns: int) -> Frame:
        """The encoder frame out of its turn; the next cyclic one comes a period later."""
        self._next_encoder_ns = now_ns + 2 * self._model.encoder_period_ns
        return self._encoder_estimates()

    def hear(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Take one frame from the bus; return the replies."""
        can_id, data = frame
        if can_id == self.setpoint_id and len(data) == 4:
            (torque,) = _UNPACK_FLOAT(data)
            if isfinite(torque):
                self.fed_ns = now_ns
                self.input_torque = torque
            else:
                self._set_torque(torque, now_ns)
            return _NONE
        if can_id & (EFF | ERR) or not self._is_mine(can_id):
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

    def _supervise(self, now_ns: int) -> None:
        if self.state is not AxisState.CLOSED_LOOP_CONTROL:
            return
        model = self._model
        if model.watchdog_ns and now_ns - self.fed_ns > model.watchdog_ns:
            self._disarm(AxisError.WATCHDOG_TIMER_EXPIRED)
        overspeed = model.overspeed_ratio * self._velocity_limit
        if model.torque_limiters and abs(self._velocity) > overspeed:
            self._disarm(AxisError.VELOCITY_LIMIT_VIOLATION)

    def _disarm(self, error: AxisError) -> None:
        self.errors |= error
        if self.state is AxisState.CLOSED_LOOP_CONTROL:
            self.disarm_reason = error
            self.result = Result.DISARMED
            self._to_idle()

    def _to_idle(self) -> None:
        self.state = AxisState.IDLE
        if self._model.zero_torque_on_disarm:
            self.input_torque = 0.0

    def _set_torque(self, torque: float, now_ns: int) -> None:
        self.fed_ns = now_ns
        if isfinite(torque):
            self.input_torque = torque
        elif torque != torque or not self._model.torque_limiters:
            self.input_torque = 0.0
            self._disarm(AxisError.BAD_CONFIG)
        else:
            self.input_torque = 3.4e38 if torque > 0 else -3.4e38

    def _table(self) -> Mapping[int, Callable[[Frame, int], Sequence[Frame]]]:
        return {
            Command.GET_VERSION: self._answer(self._version),
            Command.HEARTBEAT: self._answer(self._heartbeat),
            Command.ESTOP: self._on_estop,
            Command.GET_ERROR: self._answer(self._error),
            Command.ADDRESS: self._on_address,
            Command.SET_AXIS_STATE: self._setter(self._on_axis_state),
            Command.GET_ENCODER_ESTIMATES: self._answer(self._encoder_estimates),
            Command.SET_CONTROLLER_MODE: self._setter(self._on_controller_mode),
            Command.SET_INPUT_POS: self._setter(self._on_input_pos),
            Command.SET_INPUT_VEL: self._setter(self._on_input_vel),
            Command.SET_INPUT_TORQUE: self._setter(self._on_input_torque),
            Command.SET_LIMITS: self._setter(self._on_limits),
            Command.GET_IQ: self._answer(self._iq),
            Command.GET_TEMPERATURE: self._answer(self._temperature),
            Command.REBOOT: self._setter(self._on_reboot),
            Command.GET_BUS_VOLTAGE_CURRENT: self._answer(self._bus),
            Command.CLEAR_ERRORS: self._on_clear_errors,
            Command.SET_ABSOLUTE_POSITION: self._setter(self._on_absolute_position),
            Command.GET_TORQUES: self._answer(self._torques),
            Command.GET_POWERS: self._answer(self._powers),
        }

    def _answer(self, say: Callable[[], Frame]) -> Callable[[Frame, int], Sequence[Frame]]:
        """A Get: answered when asked; anything else on its identifier is somebody's imitation."""

        def handle(frame: Frame, _: int) -> Sequence[Frame]:
            if f.is_request(frame):
                return (say(),)
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

    # --- what it is told -------------------------------------------------------------------------

    def _on_estop(self, frame: Frame, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        self._disarm(AxisError.ESTOP_REQUESTED)
        return _NONE

    def _on_clear_errors(self, frame: Frame, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        self.errors = self.disarm_reason = AxisError(0)
        return _NONE

    def _on_axis_state(self, data: bytes, now_ns: int) -> None:
        (asked,) = f.ONE_U32.unpack(f.padded(data, 4))
        if asked == AxisState.IDLE:
            self.result = Result.SUCCESS
            self._to_idle()
        elif asked != AxisState.CLOSED_LOOP_CONTROL:
            self.result = Result.INVALID_STATE
            self._to_idle()
        elif self.errors:
            self.result = Result.DISARMED
        elif self.state is not AxisState.CLOSED_LOOP_CONTROL:
            self.result = Result.SUCCESS
            self.state = AxisState.CLOSED_LOOP_CONTROL
            self.fed_ns = now_ns

    def _on_controller_mode(self, data: bytes, _: int) -> None:
        control, mode = f.TWO_U32.unpack(f.padded(data, 8))
        try:
            self._control_mode, self._input_mode = ControlMode(control), InputMode(mode)
        except ValueError:
            self._disarm(AxisError.BAD_CONFIG)

    def _on_input_torque(self, data: bytes, now_ns: int) -> None:
        self._set_torque(f.decode_float(data), now_ns)

    def _on_input_vel(self, data: bytes, now_ns: int) -> None:
        self._set_torque(f.decode_floats(data)[1], now_ns)

    def _on_input_pos(self, data: bytes, now_ns: int) -> None:
        _, _, torque = f.INPUT_POS.unpack(f.padded(data, 8))
        self._set_torque(torque * 1e-3, now_ns)

    def _on_limits(self, data: bytes, _: int) -> None:
        velocity, current = f.decode_floats(data)
        if velocity >= 0.0 and current >= 0.0:
            self._velocity_limit, self._current_limit = velocity, current
        else:
            self.ignored += 1

    def _on_absolute_position(self, data: bytes, _: int) -> None:
        position = f.decode_float(data)
        if isfinite(position):
            self._offset += position - self._position
            self._position = position

    def _on_reboot(self, data: bytes, now_ns: int) -> None:
        if self.state is AxisState.IDLE and not f.padded(data, 1)[0]:
            self._start(self.node_id)
            self._next_heartbeat_ns = self._next_encoder_ns = self._next_other_ns = now_ns

    def _on_address(self, frame: Frame, _: int) -> Sequence[Frame]:
        data = frame.data
        if f.is_request(frame):
            return (self._address(),)
        if len(data) < 7:
            self.ignored += 1
            return _NONE
        node, serial = data[0], int.from_bytes(data[1:7], "little")
        if serial in (0, self._serial):
            self._readdress(node)
        elif node == self.node_id:
            self._readdress(f.UNADDRESSED)
        return _NONE

    def _readdress(self, node: int) -> None:
        if node <= f.UNADDRESSED:
            self.node_id = node
            self._encoder_id = f.identifier(node, Command.GET_ENCODER_ESTIMATES)
            self.setpoint_id = f.identifier(node, Command.SET_INPUT_TORQUE)

    # --- what it says ----------------------------------------------------------------------------

    def _frame(self, command: Command, data: bytes) -> Frame:
        return Frame(f.identifier(self.node_id, command), data)

    def _heartbeat(self) -> Frame:
        errors = self.errors | self.disarm_reason
        data = f.HEARTBEAT.pack(errors, self.state, self.result, 0, 0)
        return self._frame(Command.HEARTBEAT, data)

    def _encoder_estimates(self) -> Frame:
        try:
            data = _PACK_TWO(self._position, self._velocity)
        except OverflowError:  # a robot that diverges
            data = _floats(self._position, self._velocity)
        return _new(Frame, (self._encoder_id, data))

    def _version(self) -> Frame:
        return self._frame(Command.GET_VERSION, f.VERSION.pack(*_HARDWARE))

    def _error(self) -> Frame:
        return self._frame(Command.GET_ERROR, f.TWO_U32.pack(self.errors, self.disarm_reason))

    def _address(self) -> Frame:
        data = bytes((self.node_id,)) + self._serial.to_bytes(6, "little") + b"\0"
        return self._frame(Command.ADDRESS, data)

    def _iq(self) -> Frame:
        amps = self.torque_demand() / self._model.torque_constant_N_m_A
        return self._frame(Command.GET_IQ, _floats(amps, amps))

    def _temperature(self) -> Frame:
        return self._frame(
            Command.GET_TEMPERATURE, f.TWO_FLOATS.pack(_TEMPERATURE_C, _TEMPERATURE_C)
        )

    def _bus(self) -> Frame:
        watts = self._mechanical_power()
        return self._frame(Command.GET_BUS_VOLTAGE_CURRENT, _floats(_BUS_V, watts / _BUS_V))

    def _torques(self) -> Frame:
        torque = self.torque_demand()
        return self._frame(Command.GET_TORQUES, _floats(torque, torque))

    def _powers(self) -> Frame:
        watts = self._mechanical_power()
        return self._frame(Command.GET_POWERS, _floats(watts, watts))

    def _mechanical_power(self) -> float:
        return self.torque_demand() * self._velocity * 6.283185307179586


def _after(now_ns: int, period_ns: int) -> int:
    """The next multiple of the period after now: no drift, whatever was late."""
    return (now_ns // period_ns + 1) * period_ns


def _floats(first: float, second: float) -> bytes:
    """Two floats for the wire, clamped to what a single can hold."""
    limit = 3.4e38
    return f.TWO_FLOATS.pack(min(max(first, -limit), limit), min(max(second, -limit), limit))
