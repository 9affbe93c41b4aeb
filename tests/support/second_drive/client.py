"""The controller's end of the test's protocol: armed once both drives were heard."""

from collections.abc import Sequence
from math import pi

from support.second_drive.tools import ENCODER, MOTION, REV, REV_S, SET_POINT, TORQUE, PlainSection

from bridge.drives.interface import Motion
from bridge.frame import Frame
from configs.brief import DriveLink


class PlainClient:
    """Both drives of a robot."""

    notices: tuple[str, ...] = ()

    def __init__(self, link: DriveLink) -> None:
        assert isinstance(link.section, PlainSection)
        self._unit = link.section.torque_unit_shaft_N_m
        mounting = link.mounting
        self._nodes = (link.right_node, link.left_node)
        self._gears = tuple(
            sign * mounting.gear_ratio for sign in (mounting.right_sign, mounting.left_sign)
        )
        self._motion: dict[int, tuple[float, float]] = {}
        self._stamps = dict.fromkeys(self._nodes, -1)
        self.armed = False
        self.sent_wheel_N_m = (0.0, 0.0)

    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        for node, gear in zip(self._nodes, self._gears, strict=True):
            if can_id == MOTION + node:
                rev, rev_s = ENCODER.unpack(data)
                per_rev = 2.0 * pi / gear
                self._motion[node] = rev * REV * per_rev, rev_s * REV_S * per_rev
                self._stamps[node] = now_ns

    def feedback_since(self, bus_ns: int) -> bool:
        return min(self._stamps.values()) > bus_ns

    def motion(self) -> Motion | None:
        if len(self._motion) < 2:
            return None
        (right, right_speed), (left, left_speed) = (self._motion[node] for node in self._nodes)
        return right, left, right_speed, left_speed

    def arm(self, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        self.armed = min(self._stamps.values()) >= 0
        return self.torque(0.0, 0.0)

    def missing(self, now_ns: int) -> str:
        return self.fault(now_ns) or ""

    def obstacle(self, now_ns: int) -> str | None:
        return self.fault(now_ns)

    def refusal(self) -> str | None:
        return None

    def fault(self, now_ns: int) -> str | None:  # noqa: ARG002
        return None if min(self._stamps.values()) >= 0 else "a drive was not heard yet"

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> Sequence[Frame]:
        steps = [
            round(wheel / gear / self._unit)
            for wheel, gear in zip((right_wheel_N_m, left_wheel_N_m), self._gears, strict=True)
        ]
        right, left = (
            step * self._unit * gear for step, gear in zip(steps, self._gears, strict=True)
        )
        self.sent_wheel_N_m = right, left
        return [
            Frame(TORQUE + node, SET_POINT.pack(step))
            for node, step in zip(self._nodes, steps, strict=True)
        ]

    def rest(self, now_ns: int) -> Sequence[Frame]:  # noqa: ARG002
        return self.torque(0.0, 0.0)

    def disarm(self) -> Sequence[Frame]:
        self.armed = False
        return self.torque(0.0, 0.0)

    def estop(self) -> Sequence[Frame]:
        return self.disarm()
