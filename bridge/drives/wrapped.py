"""Drive clients and nodes behind the classes of `bridge.drives.interface`.

Controllers and plant call these classes directly. What a user makes only has to have their methods;
it is wrapped, and what it shows in attributes is copied after each call that may change it.
"""

from collections.abc import Sequence
from typing import Any

from mypy_extensions import mypyc_attr

from bridge.drives.interface import DriveClient, DriveMeasurements, DriveNode, Motion
from bridge.frame import Frame


def as_client(made: object) -> DriveClient:
    """A client as the class that is called."""
    return made if isinstance(made, DriveClient) else WrappedClient(made)


def as_node(made: object) -> DriveNode:
    """A node as the class that is called."""
    return made if isinstance(made, DriveNode) else WrappedNode(made)


@mypyc_attr(allow_interpreted_subclasses=True)
class WrappedClient(DriveClient):
    """Another client, as it is."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._copy()

    def _copy(self) -> None:
        self.armed = bool(self._client.armed)
        right, left = self._client.sent_wheel_N_m
        self.sent_wheel_N_m = (float(right), float(left))

    @property
    def notices(self) -> tuple[str, ...]:
        """As `DriveClient.notices`."""
        return tuple(self._client.notices)

    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """As `DriveClient.on_frame`."""
        self._client.on_frame(can_id, data, now_ns)
        self._copy()

    def feedback_since(self, bus_ns: int) -> bool:
        """As `DriveClient.feedback_since`."""
        return bool(self._client.feedback_since(bus_ns))

    def motion(self) -> Motion | None:
        """As `DriveClient.motion`."""
        motion = self._client.motion()
        if motion is None:
            return None
        right_rad, left_rad, right_rad_s, left_rad_s = motion
        return float(right_rad), float(left_rad), float(right_rad_s), float(left_rad_s)

    def arm(self, now_ns: int) -> Sequence[Frame]:
        """As `DriveClient.arm`."""
        return self._said(self._client.arm(now_ns))

    def missing(self, now_ns: int) -> str:
        """As `DriveClient.missing`."""
        return str(self._client.missing(now_ns))

    def obstacle(self, now_ns: int) -> str | None:
        """As `DriveClient.obstacle`."""
        reason: str | None = self._client.obstacle(now_ns)
        return reason

    def refusal(self) -> str | None:
        """As `DriveClient.refusal`."""
        reason: str | None = self._client.refusal()
        return reason

    def fault(self, now_ns: int) -> str | None:
        """As `DriveClient.fault`."""
        reason: str | None = self._client.fault(now_ns)
        return reason

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> Sequence[Frame]:
        """As `DriveClient.torque`."""
        return self._said(self._client.torque(right_wheel_N_m, left_wheel_N_m))

    def rest(self, now_ns: int) -> Sequence[Frame]:
        """As `DriveClient.rest`."""
        return self._said(self._client.rest(now_ns))

    def disarm(self) -> Sequence[Frame]:
        """As `DriveClient.disarm`."""
        return self._said(self._client.disarm())

    def estop(self) -> Sequence[Frame]:
        """As `DriveClient.estop`."""
        return self._said(self._client.estop())

    def _said(self, frames: Sequence[Frame]) -> Sequence[Frame]:
        self._copy()
        return frames


class WrappedNode(DriveNode):
    """Another node, as it is."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._copy()

    def _copy(self) -> None:
        node = self._node
        self.fed_ns, self.setpoint_id = node.fed_ns, node.setpoint_id
        self.ignored, self.input_torque_shaft = node.ignored, node.input_torque_shaft

    def update_encoder(self, revolutions: float, rev_s: float) -> None:
        """As `DriveNode.update_encoder`."""
        self._node.update_encoder(revolutions, rev_s)

    def lose_estimate(self) -> None:
        """As `DriveNode.lose_estimate`."""
        self._node.lose_estimate()
        self._copy()

    def due(self, now_ns: int) -> Sequence[Frame]:
        """As `DriveNode.due`."""
        return self._said(self._node.due(now_ns))

    def feedback(self, now_ns: int) -> Frame:
        """As `DriveNode.feedback`."""
        frame: Frame = self._node.feedback(now_ns)
        return frame

    def on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """As `DriveNode.on_frame`."""
        return self._said(self._node.on_frame(frame, now_ns))

    @property
    def state_in_words(self) -> str:
        """As `DriveNode.state_in_words`."""
        return str(self._node.state_in_words)

    @property
    def next_due_ns(self) -> int:
        """As `DriveNode.next_due_ns`."""
        return int(self._node.next_due_ns)

    def update_measurements(self, measurements: DriveMeasurements) -> None:
        """As `DriveNode.update_measurements`."""
        self._node.update_measurements(measurements)
        self._copy()

    def torque_demand_shaft(self, dt_s: float) -> float:
        """As `DriveNode.torque_demand_shaft`."""
        return float(self._node.torque_demand_shaft(dt_s))

    def estop(self) -> None:
        """As `DriveNode.estop`."""
        self._node.estop()
        self._copy()

    def expire_watchdog(self) -> None:
        """As `DriveNode.expire_watchdog`."""
        self._node.expire_watchdog()
        self._copy()

    def reboot(self, now_ns: int) -> None:
        """As `DriveNode.reboot`."""
        self._node.reboot(now_ns)
        self._copy()

    def trip(self, error: str | None) -> None:
        """As `DriveNode.trip`."""
        self._node.trip(error)
        self._copy()

    def _said(self, frames: Sequence[Frame]) -> Sequence[Frame]:
        self._copy()
        return frames
