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
from typing import NamedTuple

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ControlMode, InputMode
from bridge.frame import Frame
from configs.brief import DriveLink

RETRY_NS = 200_000_000
HEARTBEAT_LIMIT_NS = 500_000_000
"""A drive whose heartbeat is older than this has dropped out."""
ENCODER_PERIODS_LIMIT = 10
"""A drive whose encoder frame is older than this many periods has dropped out."""
_TURN = 2.0 * pi


class WheelReading(NamedTuple):
    """What one wheel's drive last said of its motion."""

    angle_rad: float
    speed_rad_s: float
    stamp_ns: int


class _Step(Enum):
    CLEAR = auto()
    SET = auto()
    CLOSE = auto()


class _Axis:
    """What is known of one drive."""

    __slots__ = (
        "closed_loop",
        "encoder_id",
        "errors",
        "heard_ns",
        "heartbeat_id",
        "name",
        "node",
        "reading",
        "torque_id",
    )

    def __init__(self, name: str, node: int) -> None:
        self.name = f"{name} drive (node {node})"
        self.node = node
        self.encoder_id = f.identifier(node, Command.GET_ENCODER_ESTIMATES)
        self.heartbeat_id = f.identifier(node, Command.HEARTBEAT)
        self.torque_id = f.identifier(node, Command.SET_INPUT_TORQUE)
        self.reading: WheelReading | None = None
        self.heard_ns: int | None = None
        self.closed_loop = False
        self.errors = AxisError(0)

    def frame(self, command: Command, data: bytes) -> Frame:
        return Frame(f.identifier(self.node, command), data)

    def hear_heartbeat(self, data: bytes, now_ns: int) -> None:
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
        self._step = _Step.CLEAR
        self._asked_ns: int | None = None
        self.armed = False
        self.sent = (0.0, 0.0)
        """(right, left) torque last sent [N·m], as float32 carries it."""

    @property
    def right(self) -> WheelReading | None:
        """What the right wheel's drive last said."""
        return self._right.reading

    @property
    def left(self) -> WheelReading | None:
        """What the left wheel's drive last said."""
        return self._left.reading

    def hear(self, frame: Frame, now_ns: int) -> None:
        """Take any frame from the bus."""
        can_id, data = frame
        for axis in self._axes:
            if can_id == axis.encoder_id:
                if len(data) == 8:
                    angle, speed = f.TWO_FLOATS.unpack(data)
                    axis.reading = WheelReading(angle * _TURN, speed * _TURN, now_ns)
                return
            if can_id == axis.heartbeat_id:
                if len(data) == 8:
                    axis.hear_heartbeat(data, now_ns)
                    self._note_heartbeat(now_ns)
                return

    def complete(self, now_ns: int) -> bool:
        """Whether both wheels' encoder frames of this instant are here."""
        right, left = self._right.reading, self._left.reading
        return (
            right is not None
            and left is not None
            and right.stamp_ns == now_ns
            and left.stamp_ns == now_ns
        )

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
        encoder_limit_ns = ENCODER_PERIODS_LIMIT * self._link.encoder_period_ns
        for axis in self._axes:
            if axis.heard_ns is None:
                return f"{axis.name}: no heartbeat heard yet"
            if axis.errors:
                return f"{axis.name} dropped out: {f.error_names(axis.errors)}"
            if self.armed and not axis.closed_loop:
                return f"{axis.name} dropped out: left closed loop without an error"
            if now_ns - axis.heard_ns > HEARTBEAT_LIMIT_NS:
                return f"{axis.name}: no heartbeat for {(now_ns - axis.heard_ns) * 1e-9:.1f} s"
            if axis.reading is None or now_ns - axis.reading.stamp_ns > encoder_limit_ns:
                return f"{axis.name}: no encoder frames any more"
        return None

    def torque(self, right_Nm: float, left_Nm: float) -> tuple[Frame, Frame]:
        """Set-points for both wheels [N·m]; beyond float32 they saturate."""
        right, left = _packed(right_Nm), _packed(left_Nm)
        self.sent = (_unpacked(right), _unpacked(left))
        return Frame(self._right.torque_id, right), Frame(self._left.torque_id, left)

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

    def _note_heartbeat(self, now_ns: int) -> None:
        if self._asked_ns is not None and now_ns > self._asked_ns and not self.armed:
            self.armed = self._right.ready() and self._left.ready()


def _packed(torque: float) -> bytes:
    try:
        return f.ONE_FLOAT.pack(torque)
    except OverflowError:
        return f.ONE_FLOAT.pack(3.4e38 if torque > 0 else -3.4e38)


def _unpacked(data: bytes) -> float:
    (value,) = f.ONE_FLOAT.unpack(data)
    return float(value)
