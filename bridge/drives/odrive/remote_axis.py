"""The host's model of one ODrive axis, from its frames alone.

    angle, speed    of the wheel, from the newest encoder frame whose numbers are finite
    trouble         reason not to drive its wheel: errors, an e-stop frame to it, two senders of its
                    telemetry
    heartbeat_ns    bus time of its newest heartbeat
    encoder_ns      bus time of its newest encoder frame

Requests of other hosts are counted, so that their answers don't count as those of a second sender.
"""

from typing import Final

from bridge.drives.interface import torque_factors, wheel_rad_per_shaft_rev
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.cadence import LIMIT, Cadence
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ProcedureResult
from bridge.drives.odrive.model import section_of
from bridge.frame import Frame
from configs.brief import DriveLink

NEVER: Final = -(1 << 62)
PASSING: Final = AxisError.WATCHDOG_TIMER_EXPIRED | AxisError.INITIALIZING
"""Errors of a lost connection between drive and host, which a host may clear by itself. All others,
an e-stop above all, only a person may clear."""


class RemoteAxis:
    """One drive and the wheel that it turns."""

    __slots__ = (
        "_doubled",
        "_encoder_cadence",
        "_heartbeat_cadence",
        "_heartbeats",
        "angle_wheel_rad",
        "closed_loop",
        "commanded",
        "encoder_frames",
        "encoder_ns",
        "errors",
        "heartbeat_ns",
        "name",
        "node",
        "result",
        "speed_wheel_rad_s",
        "state",
        "to_shaft",
        "to_wheel",
        "trouble",
        "wheel_rad_per_shaft_rev",
    )

    def __init__(self, name: str, node: int, sign: int, link: DriveLink) -> None:
        ratio = link.mounting.gear_ratio
        self.name = f"{name} drive (node {node})"
        self.node = node
        self.wheel_rad_per_shaft_rev = wheel_rad_per_shaft_rev(sign, ratio)
        """Wheel angle per shaft revolution."""
        self.to_shaft, self.to_wheel = torque_factors(sign, ratio)
        """Torque at the shaft per torque at the wheel, and the other way."""
        self.angle_wheel_rad = self.speed_wheel_rad_s = 0.0
        self.encoder_ns = NEVER
        self.heartbeat_ns: int | None = None
        self.state = int(AxisState.UNDEFINED)
        self.result = 0
        self.closed_loop = False
        self.errors = AxisError(0)
        self.trouble = ""
        self.commanded = 0
        """Set-points and modes sent to it by other hosts."""
        self.encoder_frames = 0
        """Encoder frames received, less those requested."""
        self._heartbeats = 0
        self._doubled = ""
        self._encoder_cadence = Cadence(link.encoder_period_ns)
        heartbeat_s = section_of(link.section).heartbeat_period_s
        self._heartbeat_cadence = Cadence(round(heartbeat_s * 1e9))

    def frame(self, command: Command, data: bytes) -> Frame:
        """A frame for this drive."""
        return Frame(f.identifier(self.node, command), data)

    # --- reception -----------------------------------------------------------------------------

    def on_heartbeat(self, data: bytes | bytearray, now_ns: int) -> bool:
        """Process a heartbeat; False if it is a request for one, or malformed."""
        if len(data) != f.HEARTBEAT.size:
            self._heartbeats -= not data
            return False
        heartbeat = f.decode_heartbeat(data)
        self._heartbeats += 1
        self.heartbeat_ns = now_ns
        self.errors = heartbeat.errors
        self.state, self.result = heartbeat.state, heartbeat.result
        self.closed_loop = heartbeat.state == AxisState.CLOSED_LOOP_CONTROL
        self._look_for_a_second_sender(now_ns)
        self._note_trouble()
        return True

    def on_request(self, command: Command) -> None:
        """Discount the answer to a request: it is no sign of a second sender."""
        if command is Command.HEARTBEAT:
            self._heartbeats -= 1
        else:
            self.encoder_frames -= 1

    def on_estop(self) -> None:
        """Note an e-stop by any host, before the next heartbeat reports it."""
        self.errors |= AxisError.ESTOP_REQUESTED
        self.closed_loop = False
        self._note_trouble()

    def _look_for_a_second_sender(self, now_ns: int) -> None:
        encoder = self._encoder_cadence.judge(self.encoder_frames, now_ns)
        heartbeat = self._heartbeat_cadence.judge(self._heartbeats, now_ns)
        if encoder is None and heartbeat is None:
            return
        doubled = [
            f"{ratio:.1f} times the {what} of one sender"
            for what, ratio in (("encoder frames", encoder), ("heartbeats", heartbeat))
            if ratio is not None and ratio > LIMIT
        ]
        self._doubled = " and ".join(doubled)

    def _note_trouble(self) -> None:
        if self.errors:
            self.trouble = f" dropped out: {f.error_names(self.errors)}"
        elif self._doubled:
            self.trouble = (
                f": {self._doubled}: a second drive with its node id, or a drive that is configured"
                " to send faster"
            )
        else:
            self.trouble = ""

    # --- conclusions --------------------------------------------------------------------------

    def ready_since(self, since_ns: int) -> bool:
        """Whether a heartbeat after `since_ns` reported closed loop, without trouble."""
        heartbeat_ns = self.heartbeat_ns
        return (
            heartbeat_ns is not None
            and heartbeat_ns > since_ns
            and self.closed_loop
            and not self.trouble
        )

    def absence(self, now_ns: int, link: DriveLink) -> str:
        """The reason why it counts as absent, "" if it is present."""
        if self.heartbeat_ns is None:
            return f"{self.name}: no heartbeat heard yet"
        if now_ns - self.heartbeat_ns > link.heartbeat_age_limit_ns:
            return f"{self.name}: no heartbeat for {(now_ns - self.heartbeat_ns) * 1e-9:.1f} s"
        if self.encoder_ns == NEVER:
            return f"{self.name}: no encoder frame heard yet"
        if now_ns - self.encoder_ns > link.encoder_age_limit_ns:
            return f"{self.name}: no encoder frames any more"
        return ""

    def obstacle(self) -> str:
        """The fault that a person must clear before arming, "" if there is none."""
        if self.trouble and not (self.errors and not self.errors & ~PASSING):
            return f"{self.name}{self.trouble}"
        return ""

    def why_not_closed(self) -> str:
        """Its reported state and last result, while closed loop is missing."""
        state = f.name_of(AxisState, self.state)
        result = f.name_of(ProcedureResult, self.result)
        return f"{self.name}: no closed loop reported yet; it is {state}, last result {result}"
