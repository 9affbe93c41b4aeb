"""The controller's end of the two ODrive axes of a robot, as on hardware.

    step       every `STEP_NS`, until the heartbeats say so
    CLEAR      both: Set_Axis_State IDLE, Clear_Errors, Set_Input_Torque 0
    SET        both: Set_Limits, Set_Controller_Mode torque / passthrough, Set_Input_Torque 0
    CLOSE      both: Set_Axis_State CLOSED_LOOP, again every `RETRY_NS`; then torque 0 every call
    ARMED      both heartbeats said CLOSED_LOOP without errors after that

Torque 0 goes out before every arm: a drive keeps the last torque it was sent, and it acts on
arming. Positive torque drives forward on both wheels. Revolutions become radians here, nowhere
else.
"""

from collections.abc import Sequence
from enum import Enum, auto
from math import pi

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ControlMode, InputMode
from bridge.frame import Frame
from configs.brief import DriveLink

RETRY_NS = 200_000_000
HEARTBEAT_LIMIT_NS = 500_000_000
"""A drive whose heartbeat is older than this has dropped out."""
ENCODER_PERIODS_LIMIT = 10
ENCODER_LIMIT_NS = 50_000_000
"""A drive whose encoder frame is older than both, periods and time, has dropped out. Machines that
are no real-time machines stand still for 10 ms now and then; drives' watchdogs allow 100 ms."""
NEVER = -(1 << 62)
FLOAT32_MAX = 3.4e38
_TURN = 2.0 * pi
_PACK_TWO = f.TWO_FLOATS.pack
_new = tuple.__new__  # of a frame, past its constructor: this is the hot path
_UNPACK_TWO = f.TWO_FLOATS.unpack

Motion = tuple[float, float, float, float]
"""(right, left) wheel angle [rad], then (right, left) wheel speed [rad/s]."""


class _Step(Enum):
    CLEAR = auto()
    SET = auto()
    CLOSE = auto()


class _Axis:
    """What is known of one drive."""

    __slots__ = (
        "angle_rad",
        "closed_loop",
        "errors",
        "heard_ns",
        "name",
        "node",
        "speed_rad_s",
        "stamp_ns",
    )

    def __init__(self, name: str, node: int) -> None:
        self.name = f"{name} drive (node {node})"
        self.node = node
        self.angle_rad = self.speed_rad_s = 0.0
        self.stamp_ns = NEVER
        self.heard_ns: int | None = None
        self.closed_loop = False
        self.errors = AxisError(0)

    def frame(self, command: Command, data: bytes) -> Frame:
        return Frame(f.identifier(self.node, command), data)

    def hear_heartbeat(self, data: bytes | bytearray, now_ns: int) -> None:
        heartbeat = f.decode_heartbeat(data)
        self.heard_ns = now_ns
        self.errors = heartbeat.errors
        self.closed_loop = heartbeat.state == AxisState.CLOSED_LOOP_CONTROL

    def ready(self) -> bool:
        return self.closed_loop and not self.errors


class OdriveClient:
    """Drives the right and the left wheel of one robot."""

    def __init__(self, link: DriveLink) -> None:
        self._link = link
        self._right = _Axis("right", link.right_node)
        self._left = _Axis("left", link.left_node)
        self._axes = (self._right, self._left)
        self._encoders = self._by_id(Command.GET_ENCODER_ESTIMATES)
        self._heartbeats = self._by_id(Command.HEARTBEAT)
        self._encoder_limit_ns = max(
            ENCODER_LIMIT_NS, ENCODER_PERIODS_LIMIT * link.encoder_period_ns
        )
        self._torque_ids = tuple(self._by_id(Command.SET_INPUT_TORQUE))
        self._step = _Step.CLEAR
        self._asked_ns: int | None = None
        self.armed = False
        self.sent = (0.0, 0.0)
        """(right, left) torque last sent [N·m], as float32 carries it."""

    def hear(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """Take any frame from the bus."""
        axis = self._encoders.get(can_id)
        if axis is not None:
            if len(data) == 8:
                angle, speed = _UNPACK_TWO(data)
                axis.angle_rad = angle * _TURN
                axis.speed_rad_s = speed * _TURN
                axis.stamp_ns = now_ns
            return
        axis = self._heartbeats.get(can_id)
        if axis is not None and len(data) == 8:
            axis.hear_heartbeat(data, now_ns)
            self._note_heartbeat(now_ns)

    def heard_since(self, bus_ns: int) -> bool:
        """Whether both wheels' encoder frames came after this bus time."""
        return self._right.stamp_ns > bus_ns and self._left.stamp_ns > bus_ns

    def motion(self) -> Motion | None:
        """The newest wheel angles and speeds, None before both wheels were heard."""
        right, left = self._right, self._left
        if right.stamp_ns == NEVER or left.stamp_ns == NEVER:
            return None
        return right.angle_rad, left.angle_rad, right.speed_rad_s, left.speed_rad_s

    def arm(self, now_ns: int) -> Sequence[Frame]:
        """What to send next on the way to `armed`; call once per period."""
        match self._step:
            case _Step.CLEAR:
                self._step = _Step.SET
                return [
                    frame
                    for axis in self._axes
                    for frame in (
                        axis.frame(Command.SET_AXIS_STATE, f.ONE_U32.pack(AxisState.IDLE)),
                        axis.frame(Command.CLEAR_ERRORS, b"\0"),
                        axis.frame(Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(0.0)),
                    )
                ]
            case _Step.SET:
                self._step = _Step.CLOSE
                limits = f.TWO_FLOATS.pack(
                    self._link.velocity_limit_rev_s, self._link.current_limit_A
                )
                mode = f.TWO_U32.pack(ControlMode.TORQUE, InputMode.PASSTHROUGH)
                return [
                    frame
                    for axis in self._axes
                    for frame in (
                        axis.frame(Command.SET_LIMITS, limits),
                        axis.frame(Command.SET_CONTROLLER_MODE, mode),
                    )
                ]
            case _Step.CLOSE:
                zero = self.torque(0.0, 0.0)
                if self._asked_ns is not None and now_ns - self._asked_ns < RETRY_NS:
                    return zero
                self._asked_ns = now_ns
                state = f.ONE_U32.pack(AxisState.CLOSED_LOOP_CONTROL)
                return [
                    *zero,
                    *(axis.frame(Command.SET_AXIS_STATE, state) for axis in self._axes),
                ]

    def fault(self, now_ns: int) -> str | None:
        """Why the wheels can't be driven now, None if they can."""
        encoder_limit_ns = self._encoder_limit_ns
        for axis in self._axes:
            if axis.heard_ns is None:
                return f"{axis.name}: no heartbeat heard yet"
            if axis.errors:
                return f"{axis.name} dropped out: {f.error_names(axis.errors)}"
            if self.armed and not axis.closed_loop:
                return f"{axis.name} dropped out: left closed loop without an error"
            if now_ns - axis.heard_ns > HEARTBEAT_LIMIT_NS:
                return f"{axis.name}: no heartbeat for {(now_ns - axis.heard_ns) * 1e-9:.1f} s"
            if now_ns - axis.stamp_ns > encoder_limit_ns:
                return f"{axis.name}: no encoder frames any more"
        return None

    def torque(self, right_Nm: float, left_Nm: float) -> tuple[Frame, Frame]:
        """Set-points for both wheels [N·m]; beyond float32 they saturate."""
        try:
            both = _PACK_TWO(right_Nm, left_Nm)
        except OverflowError:
            both = _PACK_TWO(_saturated(right_Nm), _saturated(left_Nm))
        self.sent = _UNPACK_TWO(both)
        right_id, left_id = self._torque_ids
        return _new(Frame, (right_id, both[:4])), _new(Frame, (left_id, both[4:]))

    def disarm(self) -> Sequence[Frame]:
        """Torque 0 and idle for both wheels."""
        self.armed = False
        self._step = _Step.CLEAR
        self._asked_ns = None
        state = f.ONE_U32.pack(AxisState.IDLE)
        return [
            *self.torque(0.0, 0.0),
            *(axis.frame(Command.SET_AXIS_STATE, state) for axis in self._axes),
        ]

    def estop(self) -> Sequence[Frame]:
        """Emergency stop for both wheels, latched until their errors are cleared."""
        self.armed = False
        return [axis.frame(Command.ESTOP, b"") for axis in self._axes]

    def _by_id(self, command: Command) -> dict[int, _Axis]:
        return {f.identifier(axis.node, command): axis for axis in self._axes}

    def _note_heartbeat(self, now_ns: int) -> None:
        if self._asked_ns is not None and now_ns > self._asked_ns and not self.armed:
            self.armed = self._right.ready() and self._left.ready()


def _saturated(torque: float) -> float:
    return min(max(torque, -FLOAT32_MAX), FLOAT32_MAX)
