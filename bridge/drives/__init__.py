"""Drive protocols: a folder each, with frames, client (host) and node (drive).

`DRIVES` lists what exists: the name in the scenario, the controller's end of a robot's two drives,
and the emulated drive of one wheel. Both ends are pure: frames in, frames out, told the time.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol

from bridge.drives.feeling import Feeling
from bridge.drives.odrive.local_axis import OdriveNode
from bridge.drives.odrive.remote_axis import Motion, OdriveClient
from bridge.frame import Frame
from configs.brief import DriveLink, DriveModel


class DriveClient(Protocol):
    """The controller's end of the two drives of a robot."""

    armed: bool
    sent: tuple[float, float]

    @property
    def notices(self) -> tuple[str, ...]:
        """What somebody else did to the drives: for the report."""

    def hear(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """Take any frame from the bus."""

    def heard_since(self, bus_ns: int) -> bool:
        """Whether both wheels' encoder frames came after this bus time."""

    def motion(self) -> Motion | None:
        """The newest wheel angles and speeds, None before both wheels were heard."""

    def arm(self, now_ns: int) -> Sequence[Frame]:
        """What to send next on the way to `armed`; call once per period."""

    def missing(self, now_ns: int) -> str:
        """What of each drive keeps the robot from being armed, "" if nothing does."""

    def obstacle(self, now_ns: int) -> str | None:
        """Why arming must not even be tried now, None if it may."""

    def refusal(self) -> str | None:
        """What a person has to mend before the drives may be armed again, None if nothing."""

    def fault(self, now_ns: int) -> str | None:
        """Why the wheels can't be driven now, None if they can."""

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> Sequence[Frame]:
        """Set-points for both wheels [N·m]; `sent` then says what the bus carries of them."""

    def rest(self, now_ns: int) -> Sequence[Frame]:
        """Torque 0 for both wheels, and whatever keeps them disarmed; call once per period."""

    def disarm(self) -> Sequence[Frame]:
        """Torque 0 and idle for both wheels; the way to `armed` begins anew."""

    def estop(self) -> Sequence[Frame]:
        """Emergency stop for both wheels."""


class DriveNode(Protocol):
    """The emulated drive of one wheel."""

    fed_ns: int
    """When it last took a set-point, bus time."""
    setpoint_id: int
    """The identifier of the set-point that it takes at its address now; negative: it takes none."""

    def feed(self, revolutions: float, rev_s: float) -> None:
        """Take what the encoder says: position [rev] and speed [rev/s] of the shaft."""

    def lose_estimate(self) -> None:
        """The encoder's estimate is gone for good: disarm with that error, which nothing clears."""

    def due(self, now_ns: int) -> Sequence[Frame]:
        """Frames due until this instant, the newest of each; the drive supervises itself first."""

    def feedback(self, now_ns: int) -> Frame:
        """The encoder frame out of its turn; the next cyclic one comes a period later."""

    def hear(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Take one frame from the bus; return the replies."""

    @property
    def input_torque_shaft(self) -> float:
        """The torque that the set-point said [N·m], before limits."""

    @property
    def next_due_ns(self) -> int:
        """The earliest bus time at which `due` has something to do; after its last call."""

    def feel(self, feeling: Feeling) -> None:
        """Take what the drive measures."""

    def torque_demand_shaft(self, dt_s: float) -> float:
        """Torque that the drive asks of its motor for the next `dt_s` [N·m]; always finite."""


class DriveProtocol(NamedTuple):
    """Both ends of one protocol."""

    client: Callable[[DriveLink], DriveClient]
    node: Callable[[DriveModel, int, int], DriveNode]  # model, node id, serial number


DRIVES: Mapping[str, DriveProtocol] = {"odrive": DriveProtocol(OdriveClient, OdriveNode)}
