"""A drive client that sends nothing, for a dry run on a robot whose wheels must not turn.

It receives and supervises the drives like the client that it wraps, is `armed` while they have no
fault, and sends no frame, so another controller may drive the robot meanwhile. `sent_wheel_N_m` is
the torque that the wrapped client would have sent.
"""

from collections.abc import Callable, Sequence

from bridge.drives.interface import DriveClient, Motion
from bridge.frame import Frame

_NOTHING: tuple[Frame, ...] = ()


class DryRun:
    """The controller's end of two drives, receive only."""

    def __init__(self, client: DriveClient) -> None:
        self._client = client
        self.armed = False
        self.sent_wheel_N_m = (0.0, 0.0)
        self.on_frame: Callable[[int, bytes | bytearray, int], None] = client.on_frame
        self.feedback_since: Callable[[int], bool] = client.feedback_since
        self.motion: Callable[[], Motion | None] = client.motion
        self.obstacle: Callable[[int], str | None] = client.obstacle
        self.refusal: Callable[[], str | None] = client.refusal
        self.fault: Callable[[int], str | None] = client.fault

    @property
    def notices(self) -> tuple[str, ...]:
        """Commands of other hosts to the drives, in words."""
        return self._client.notices

    def arm(self, now_ns: int) -> Sequence[Frame]:
        """No frames; armed once the drives have no fault."""
        self.armed = self._client.fault(now_ns) is None
        return _NOTHING

    def missing(self, now_ns: int) -> str:
        """The fault of the drives, "" if there is none."""
        return self._client.fault(now_ns) or ""

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> Sequence[Frame]:
        """No frames; sets `sent_wheel_N_m` to the torque that would have been sent."""
        self._client.torque(right_wheel_N_m, left_wheel_N_m)
        self.sent_wheel_N_m = self._client.sent_wheel_N_m
        return _NOTHING

    def rest(self, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        """Nothing to send."""
        self.sent_wheel_N_m = (0.0, 0.0)
        return _NOTHING

    def disarm(self) -> Sequence[Frame]:
        """Nothing to send."""
        self.armed = False
        self.sent_wheel_N_m = (0.0, 0.0)
        return _NOTHING

    def estop(self) -> Sequence[Frame]:
        """Nothing to send: another host may drive the robot."""
        return self.disarm()
