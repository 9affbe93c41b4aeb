"""The controller's end of the two ODrive axes of a robot, as on hardware.

    step       one a call of `arm`
    CLEAR      both: Set_Axis_State IDLE, Clear_Errors, Set_Input_Torque 0
    SET        both: Set_Limits, Set_Controller_Mode torque / passthrough, Set_Input_Torque 0
    CLOSE      both: Set_Axis_State CLOSED_LOOP, again every `RETRY_NS`; then torque 0 every call
    armed      both heartbeats report CLOSED_LOOP without errors after that

The sequence begins once both drives are present, and anew when one is absent or reports a passing
error in CLOSE (`PASSING` of `remote_axis`). Torque 0 goes out before every arm: a drive keeps the
last torque that it received, which acts on arming. `disarm` begins anew: only these steps lead from
a fault back to torque. A drive that drops out, falls silent, is stopped by another host, or whose
identifiers have two senders, is a `fault` of the robot: the other wheel must not turn alone.

Positive torque drives forward on both wheels. Revolutions of the shaft become radians of the wheel
here, and torques at the wheel torques at the shaft, nowhere else.
"""

from collections.abc import Callable, Sequence
from enum import Enum, auto
from functools import partial
from typing import Final

from bridge.drives.interface import DriveClient, Motion
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisState, Command, ControlMode, InputMode
from bridge.drives.odrive.model import section_of
from bridge.drives.odrive.remote_axis import NEVER, RemoteAxis
from bridge.frame import RTR, Frame
from configs.brief import DriveLink

RETRY_NS: Final = 200_000_000
REPEAT_NS: Final = 50_000_000
"""Period of IDLE requests to a drive that should be idle and reports another state."""
FLOAT32_MAX: Final = 3.4e38
_FOREIGN: Final = (
    Command.SET_AXIS_STATE,
    Command.SET_CONTROLLER_MODE,
    Command.SET_INPUT_POS,
    Command.SET_INPUT_VEL,
    Command.SET_INPUT_TORQUE,
    Command.SET_LIMITS,
)

_Handler = Callable[[bytes | bytearray, int], None]


class _Step(Enum):
    CLEAR = auto()
    SET = auto()
    CLOSE = auto()


class OdriveClient(DriveClient):
    """Drives the right and the left wheel of one robot."""

    def __init__(self, link: DriveLink) -> None:
        self._link = link
        self._limits = section_of(link.section).limits(limited=link.limited)
        self._right = RemoteAxis("right", link.right_node, link.mounting.right_sign, link)
        self._left = RemoteAxis("left", link.left_node, link.mounting.left_sign, link)
        self._axes = (self._right, self._left)
        self._right_encoder_id, self._left_encoder_id = self._by_id(Command.GET_ENCODER_ESTIMATES)
        self._others = self._handlers_by_id()
        self._encoder_limit_ns = link.encoder_age_limit_ns
        self._heartbeat_limit_ns = link.heartbeat_age_limit_ns
        self._right_id, self._left_id = self._by_id(Command.SET_INPUT_TORQUE)
        self._to_shaft = (self._right.to_shaft, self._left.to_shaft)
        self._to_wheel = (self._right.to_wheel, self._left.to_wheel)
        self._step = _Step.CLEAR
        self._asked_ns: int | None = None
        self._closing_ns: int | None = None
        self._idled_ns = NEVER
        self._well_until_ns = NEVER
        """Bus time until which the heartbeats of both drives, in closed loop and sound, count."""
        self.armed = False
        self.sent_wheel_N_m = (0.0, 0.0)
        """(right, left) torque last sent, at the wheels [N·m], as float32 carries it."""

    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """Process any frame from the bus."""
        axis: RemoteAxis | None = None
        if can_id == self._right_encoder_id:
            axis = self._right
        elif can_id == self._left_encoder_id:
            axis = self._left
        if axis is None:
            handler = self._others.get(can_id)
            if handler is not None:
                handler(data, now_ns)
        elif len(data) == 8:
            data = data if isinstance(data, bytes) else bytes(data)
            angle, speed = f.float_at(data, 0), f.float_at(data, 4)
            total = angle + speed
            if total - total == 0.0:  # both are finite
                axis.angle_wheel_rad = angle * axis.wheel_rad_per_shaft_rev
                axis.speed_wheel_rad_s = speed * axis.wheel_rad_per_shaft_rev
                axis.encoder_ns = now_ns
                axis.encoder_frames += 1
        elif not data:
            axis.on_request(Command.GET_ENCODER_ESTIMATES)

    def feedback_since(self, bus_ns: int) -> bool:
        """Whether both wheels' encoder frames were received after this bus time [ns]."""
        return self._right.encoder_ns > bus_ns and self._left.encoder_ns > bus_ns

    def motion(self) -> Motion | None:
        """The newest wheel angles and speeds, None before the first encoder frames of both."""
        right, left = self._right, self._left
        if right.encoder_ns == NEVER or left.encoder_ns == NEVER:
            return None
        return (
            right.angle_wheel_rad,
            left.angle_wheel_rad,
            right.speed_wheel_rad_s,
            left.speed_wheel_rad_s,
        )

    # --- arming ----------------------------------------------------------------------------------

    def arm(self, now_ns: int) -> Sequence[Frame]:
        """The next frames of the arming sequence; call once per period."""
        zero = self.torque(0.0, 0.0)
        if any(axis.absence(now_ns, self._link) for axis in self._axes):
            self._begin_anew()  # an absent drive misses its steps
            return zero
        match self._step:
            case _Step.CLEAR:
                self._step = _Step.SET
                return [
                    frame
                    for axis, nothing in zip(self._axes, zero, strict=True)
                    for frame in (
                        axis.frame(Command.SET_AXIS_STATE, f.ONE_U32.pack(AxisState.IDLE)),
                        axis.frame(Command.CLEAR_ERRORS, b"\0"),
                        nothing,
                    )
                ]
            case _Step.SET:
                self._step = _Step.CLOSE
                limits = f.TWO_FLOATS.pack(*self._limits)
                mode = f.TWO_U32.pack(ControlMode.TORQUE, InputMode.PASSTHROUGH)
                return [
                    frame
                    for axis, nothing in zip(self._axes, zero, strict=True)
                    for frame in (
                        axis.frame(Command.SET_LIMITS, limits),
                        axis.frame(Command.SET_CONTROLLER_MODE, mode),
                        nothing,
                    )
                ]
            case _Step.CLOSE:
                if self._asked_ns is not None and now_ns - self._asked_ns < RETRY_NS:
                    return zero
                if self._asked_ns is None:
                    self._closing_ns = now_ns
                elif any(axis.errors for axis in self._axes) and self.refusal() is None:
                    self._begin_anew()
                    return zero
                self._asked_ns = now_ns
                state = f.ONE_U32.pack(AxisState.CLOSED_LOOP_CONTROL)
                return [
                    *zero,
                    *(axis.frame(Command.SET_AXIS_STATE, state) for axis in self._axes),
                ]

    def missing(self, now_ns: int) -> str:
        """The reasons why each drive is not armed, "" if there are none."""
        reasons = []
        for axis in self._axes:
            reason = axis.absence(now_ns, self._link)
            if not reason and axis.trouble:
                reason = f"{axis.name}{axis.trouble}"
            if not reason and not self.armed and not axis.closed_loop:
                reason = axis.why_not_closed()
            reasons.append(reason)
        return "; ".join(filter(None, reasons))

    def obstacle(self, now_ns: int) -> str | None:
        """The reason not to begin arming now, None if there is none.

        Absent drives, and errors that only a person may clear, are obstacles; those that a host may
        clear by itself are `bridge.drives.odrive.remote_axis.PASSING`.
        """
        for axis in self._axes:
            if reason := axis.absence(now_ns, self._link) or axis.obstacle():
                return reason
        return None

    def refusal(self) -> str | None:
        """The fault that only a person may clear before the drives are armed again, or None."""
        return next(filter(None, (axis.obstacle() for axis in self._axes)), None)

    def fault(self, now_ns: int) -> str | None:
        """The fault that keeps the wheels from being driven now, None if there is none."""
        if now_ns <= self._well_until_ns:
            since_ns = now_ns - self._encoder_limit_ns
            if self._right.encoder_ns >= since_ns and self._left.encoder_ns >= since_ns:
                return None
        for axis in self._axes:
            if axis.trouble:
                return f"{axis.name}{axis.trouble}"
            heartbeat_ns = axis.heartbeat_ns
            if (
                heartbeat_ns is None
                or now_ns - heartbeat_ns > self._heartbeat_limit_ns
                or now_ns - axis.encoder_ns > self._encoder_limit_ns
            ):
                return axis.absence(now_ns, self._link)
            if self.armed and not axis.closed_loop:
                return f"{axis.name} dropped out: left closed loop without an error"
        return None

    @property
    def notices(self) -> tuple[str, ...]:
        """Commands of other hosts to the drives, in words."""
        return tuple(
            f"{axis.name}: {axis.commanded} commands of another host"
            for axis in self._axes
            if axis.commanded
        )

    # --- torque ----------------------------------------------------------------------------------

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> tuple[Frame, Frame]:
        """Set-points for both wheels [N·m]; beyond float32 they saturate."""
        to_right, to_left = self._to_shaft
        right_shaft, left_shaft = right_wheel_N_m * to_right, left_wheel_N_m * to_left
        try:
            right, left = f.float_data(right_shaft), f.float_data(left_shaft)
        except OverflowError:
            right, left = (
                f.float_data(_saturated(right_shaft)),
                f.float_data(_saturated(left_shaft)),
            )
        of_right, of_left = self._to_wheel
        self.sent_wheel_N_m = (f.float_at(right, 0) * of_right, f.float_at(left, 0) * of_left)
        return Frame(self._right_id, right), Frame(self._left_id, left)

    def disarm(self) -> Sequence[Frame]:
        """Torque 0 and idle for both wheels; the way to `armed` begins anew."""
        self.armed = False
        self._begin_anew()
        self._idled_ns = NEVER
        return [*self.torque(0.0, 0.0), *self._idle(self._axes)]

    def rest(self, now_ns: int) -> Sequence[Frame]:
        """Torque 0 for both wheels, and IDLE to a drive in closed loop; call once per period."""
        zero = self.torque(0.0, 0.0)
        awake = [axis for axis in self._axes if axis.closed_loop]
        if not awake or now_ns - self._idled_ns < REPEAT_NS:
            return zero
        self._idled_ns = now_ns
        return [*zero, *self._idle(awake)]

    def estop(self) -> Sequence[Frame]:
        """Emergency stop for both wheels, latched until their errors are cleared."""
        self.armed = False
        return [axis.frame(Command.ESTOP, b"") for axis in self._axes]

    def _begin_anew(self) -> None:
        self._step = _Step.CLEAR
        self._asked_ns = self._closing_ns = None

    def _idle(self, axes: Sequence[RemoteAxis]) -> list[Frame]:
        state = f.ONE_U32.pack(AxisState.IDLE)
        return [axis.frame(Command.SET_AXIS_STATE, state) for axis in axes]

    # --- other frames ----------------------------------------------------------------------------

    def _by_id(self, command: Command) -> dict[int, RemoteAxis]:
        return {f.identifier(axis.node, command): axis for axis in self._axes}

    def _handlers_by_id(self) -> dict[int, _Handler]:
        """Handlers of all but encoder frames: heartbeats, requests and commands of other hosts."""
        handlers: dict[int, _Handler] = {}
        for axis in self._axes:
            handlers[f.identifier(axis.node, Command.HEARTBEAT)] = partial(self._on_heartbeat, axis)
            for asked in (Command.HEARTBEAT, Command.GET_ENCODER_ESTIMATES):
                handlers[f.identifier(axis.node, asked) | RTR] = partial(_on_request, axis, asked)
            for command in _FOREIGN:
                handlers[f.identifier(axis.node, command)] = partial(_on_command, axis)
            for flag in (0, RTR):
                handlers[f.identifier(axis.node, Command.ESTOP) | flag] = partial(
                    self._on_estop, axis
                )
        return handlers

    def _on_heartbeat(self, axis: RemoteAxis, data: bytes | bytearray, now_ns: int) -> None:
        since_ns = self._closing_ns
        if axis.on_heartbeat(data, now_ns) and since_ns is not None and not self.armed:
            self.armed = self._right.ready_since(since_ns) and self._left.ready_since(since_ns)
        self._update_health()

    def _on_estop(self, axis: RemoteAxis, _data: bytes | bytearray, _now_ns: int) -> None:
        axis.on_estop()
        self._update_health()

    def _update_health(self) -> None:
        well = all(axis.closed_loop and not axis.trouble for axis in self._axes)
        heartbeat_ns = min(axis.heartbeat_ns or NEVER for axis in self._axes)
        self._well_until_ns = heartbeat_ns + self._heartbeat_limit_ns if well else NEVER


def _on_request(axis: RemoteAxis, asked: Command, _data: bytes | bytearray, _now_ns: int) -> None:
    axis.on_request(asked)


def _on_command(axis: RemoteAxis, _data: bytes | bytearray, _now_ns: int) -> None:
    axis.commanded += 1


def _saturated(torque: float) -> float:
    return min(max(torque, -FLOAT32_MAX), FLOAT32_MAX)
