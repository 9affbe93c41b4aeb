"""A drive client that sends nothing, for a dry run on a robot whose wheels must not turn.

It receives and supervises the drives like the client that it wraps, is `armed` while they have no
fault, and sends no frame, so another controller may drive the robot meanwhile. `sent_wheel_N_m` is
the torque that the wrapped client would have sent.
"""

from collections.abc import Sequence
from typing import Final

from bridge.drives.interface import DriveClient, Motion
from bridge.frame import Frame

_NOTHING: Final[tuple[Frame, ...]] = ()


class DryRun(DriveClient):
    """The controller's end of two drives, receive only."""

    def __init__(self, client: DriveClient) -> None:
        self._client = client
        self.armed = False
        self.sent_wheel_N_m = (0.0, 0.0)

    @property
    def notices(self) -> tuple[str, ...]:
        """Commands of other hosts to the drives, in words."""
        return self._client.notices

    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """As the client that is wrapped."""
        self._client.on_frame(can_id, data, now_ns)

    def feedback_since(self, bus_ns: int) -> bool:
        """As the client that is wrapped."""
        return self._client.feedback_since(bus_ns)

    def motion(self) -> Motion | None:
        """As the client that is wrapped."""
        return self._client.motion()

    def obstacle(self, now_ns: int) -> str | None:
        """As the client that is wrapped."""
        return self._client.obstacle(now_ns)

    def refusal(self) -> str | None:
        """As the client that is wrapped."""
        return self._client.refusal()

    def fault(self, now_ns: int) -> str | None:
        """As the client that is wrapped."""
        return self._client.fault(now_ns)

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
