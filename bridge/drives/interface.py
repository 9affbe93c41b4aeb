"""The interface of all drive protocols: both ends, measurements, and a row of `DRIVES`.

A client is at the wheels: it converts to and from the shaft by the mounting of its robot. A node is
at the motor's shaft. Both are pure: frames in, frames out, told the time.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import pi
from typing import Final, NamedTuple, Protocol

from mypy_extensions import mypyc_attr

from bridge.frame import Frame
from configs.brief import DriveLink, DriveModel
from configs.drives import Drive

Motion = tuple[float, float, float, float]
"""(right, left) wheel angle [rad], then (right, left) wheel speed [rad/s]."""


def wheel_rad_per_shaft_rev(sign: int, gear_ratio: float) -> float:
    """Wheel angle [rad] per revolution of the shaft, of a drive mounted with this sign."""
    return 2.0 * pi * sign / gear_ratio


def torque_factors(sign: int, gear_ratio: float) -> tuple[float, float]:
    """Torque at the shaft per torque at the wheel, and the other way."""
    return sign / gear_ratio, sign * gear_ratio


class DriveMeasurements:
    """A drive's measurements of its motor and of the supply."""

    __slots__ = ("bus_A", "bus_V", "current_A", "fet_C", "motor_C", "torque_shaft_N_m")

    def __init__(
        self,
        torque_shaft_N_m: float,
        current_A: float,
        fet_C: float,
        motor_C: float,
        bus_V: float,
        bus_A: float,
    ) -> None:
        self.torque_shaft_N_m: Final = torque_shaft_N_m  # the motor's, estimated
        self.current_A: Final = current_A  # q axis
        self.fet_C: Final = fet_C
        self.motor_C: Final = motor_C  # NaN: no thermistor
        self.bus_V: Final = bus_V
        self.bus_A: Final = bus_A


@mypyc_attr(allow_interpreted_subclasses=True)
class DriveClient(ABC):
    """The controller's end of the two drives of a robot.

    One of your own has these methods, whether it derives from this class or not.
    """

    armed: bool
    sent_wheel_N_m: tuple[float, float]
    """(right, left) torque last sent, at the wheels [N·m], as the bus carries it."""

    @property
    @abstractmethod
    def notices(self) -> tuple[str, ...]:
        """Commands of other hosts to the drives, in words."""

    @abstractmethod
    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """Process any frame from the bus."""

    @abstractmethod
    def feedback_since(self, bus_ns: int) -> bool:
        """Whether both wheels' encoder frames were received after this bus time [ns]."""

    @abstractmethod
    def motion(self) -> Motion | None:
        """The newest wheel angles and speeds, None before the first encoder frames of both."""

    @abstractmethod
    def arm(self, now_ns: int) -> Sequence[Frame]:
        """The next frames of the arming sequence; call once per period."""

    @abstractmethod
    def missing(self, now_ns: int) -> str:
        """The reasons why each drive is not armed, "" if there are none."""

    @abstractmethod
    def obstacle(self, now_ns: int) -> str | None:
        """The reason not to begin arming now, None if there is none."""

    @abstractmethod
    def refusal(self) -> str | None:
        """The fault that only a person may clear before the drives are armed again, or None."""

    @abstractmethod
    def fault(self, now_ns: int) -> str | None:
        """The fault that keeps the wheels from being driven now, None if there is none."""

    @abstractmethod
    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> Sequence[Frame]:
        """Set-points for both wheels; `sent_wheel_N_m` is then their value on the bus."""

    @abstractmethod
    def rest(self, now_ns: int) -> Sequence[Frame]:
        """Torque 0 for both wheels, and frames that keep them disarmed; call once per period."""

    @abstractmethod
    def disarm(self) -> Sequence[Frame]:
        """Torque 0 and idle for both wheels; the way to `armed` begins anew."""

    @abstractmethod
    def estop(self) -> Sequence[Frame]:
        """Emergency stop for both wheels."""


@mypyc_attr(allow_interpreted_subclasses=True)
class DriveNode(ABC):
    """The emulated drive of one wheel.

    One of your own has these methods, whether it derives from this class or not.
    """

    fed_ns: int
    """Bus time of its last set-point: the last feed of the watchdog."""
    setpoint_id: int
    """The identifier of its set-points at its present address; negative: it accepts none."""
    ignored: int
    """Frames to it without an effect: unknown commands, values and lengths that it doesn't take."""
    input_torque_shaft: float
    """Torque of the last set-point at the shaft [N·m], before limits."""

    @abstractmethod
    def update_encoder(self, revolutions: float, rev_s: float) -> None:
        """Set the encoder's position [rev] and speed [rev/s] of the shaft."""

    @abstractmethod
    def lose_estimate(self) -> None:
        """The encoder's estimate is gone for good: disarm with that error, which nothing clears."""

    @abstractmethod
    def due(self, now_ns: int) -> Sequence[Frame]:
        """Frames due until this instant, the newest of each; the drive supervises itself first."""

    @abstractmethod
    def feedback(self, now_ns: int) -> Frame:
        """The encoder frame out of its turn; the next cyclic one comes a period later."""

    @abstractmethod
    def on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Process one frame from the bus; return the replies."""

    @property
    @abstractmethod
    def state_in_words(self) -> str:
        """Its state, and after a colon the errors that disarmed it or are active, if any."""

    @property
    @abstractmethod
    def next_due_ns(self) -> int:
        """The earliest bus time at which `due` has an effect; valid after its last call."""

    @abstractmethod
    def update_measurements(self, measurements: DriveMeasurements) -> None:
        """Set the drive's measurements of its motor and supply."""

    @abstractmethod
    def torque_demand_shaft(self, dt_s: float) -> float:
        """Torque asked of the motor for the next `dt_s`, at its shaft [N·m]; always finite."""

    # Faults of the drive itself: those that its section has no `Drive.fault_problem` with.

    def estop(self) -> None:
        """Its emergency stop is pressed."""
        raise NotImplementedError

    def expire_watchdog(self) -> None:
        """Its watchdog expires, whatever was fed."""
        raise NotImplementedError

    def reboot(self, now_ns: int) -> None:
        """Its firmware boots anew, whatever it is doing."""
        raise NotImplementedError

    def trip(self, error: str | None) -> None:
        """It disarms with one of its section's `Drive.errors`; None: with the first one."""
        raise NotImplementedError


class CyclicMessage(NamedTuple):
    """A message that is sent every period, for the load of a bus."""

    can_id: int
    period_ns: int
    payloads: Sequence[bytes]  # typical ones: stuff bits depend on them


class NodeSeen(NamedTuple):
    """A node of a protocol that sent a frame or was sent one."""

    node: int
    state: str = ""  # "" unless the frame says it, as errors
    errors: str = ""


class SignalFormat(NamedTuple):
    """One field of a message, little endian; the raw number times `scale` is in `unit`."""

    name: str
    first_bit: int  # its least significant one
    bits: int
    is_float: bool = False  # IEEE-754 single
    signed: bool = False
    scale: float = 1.0
    unit: str = ""
    values: Mapping[int, str] = {}  # words for numbers
    selects: bool = False
    """Its number tells which of the fields with `selected_by` is there."""
    selected_by: int | None = None
    comment: str = ""


class MessageFormat(NamedTuple):
    """One message of a node."""

    can_id: int
    name: str
    length: int  # bytes; frames may be longer
    from_drive: bool
    from_host: bool
    signals: Sequence[SignalFormat]
    comment: str = ""


class Versions(NamedTuple):
    """Versions that a drive has."""

    firmware: tuple[int, int, int]
    hardware: tuple[int, int, int]


class VersionQuery(Protocol):
    """Requests the versions of the first drive on a bus."""

    versions: Versions | None
    """The answer, None before it."""

    def on_frame(self, frame: Frame) -> Frame | None:
        """Process a frame from the bus; return the request, once."""

    @property
    def missing(self) -> str:
        """The frame that is still awaited, in words."""


class EndpointFile(Protocol):
    """The vendor's file of a drive's parameters, as its scripts read it."""

    def versions_of(self, firmware: str | None) -> Versions:
        """The versions of an emulated drive; None: of the firmware that drives have by default.

        Raises:
            ValueError: no emulated drive has this firmware.
        """

    def query(self) -> VersionQuery:
        """A question to a drive on a bus."""

    def contents(self, versions: Versions) -> Mapping[str, object]:
        """The file of these versions, for JSON."""


class DriveProtocol(NamedTuple):
    """A row of `configs.drives.DRIVES`: everything that belongs to one protocol."""

    client: Callable[[DriveLink], object]
    """Makes a `DriveClient`, or what has its methods: `bridge.drives.wrapped` calls either."""
    node: Callable[[DriveModel, int, int], object]
    """Makes a `DriveNode`, or what has its methods; of model, node id, serial number."""
    cyclic_messages: Callable[[DriveModel, int, int, float], Sequence[CyclicMessage]]
    """Of one drive and its set-points: model, node id, control period [ns], and gear: signed shaft
    revolutions per wheel revolution."""
    words: Callable[[Frame], str]
    """A frame in one line for people, "" if it isn't the protocol's."""
    node_seen: Callable[[Frame], NodeSeen | None]
    """The node that a frame concerns, None if it isn't the protocol's."""
    section: type[Drive] = Drive
    """Keys of [drive]; both ends find theirs in `DriveLink.section` and `DriveModel.section`."""
    endpoints: EndpointFile | None = None
    """None: the drives have no such file."""
    formats: Callable[[int], Sequence[MessageFormat]] | None = None
    """All messages of a node, for databases of other tools; None: the protocol doesn't say."""
