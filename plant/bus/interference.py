"""The disturbance of a bus on which frames take no time, at the drives' end of it.

    dropped, duplicated    as `bridge.frame_faults` says
    delayed                passes at the first tick at or after its time, in real time with the
                           first frame after it if that is earlier; before what is newer
    silent, cut off        the drive says and hears nothing; what it would say is lost

All that a fault does to frames of a robot's controller it does between the bus and the drives:
other clients hear them. What a drive says is lost, late or double for all clients.
"""

from collections.abc import Sequence
from heapq import heappop, heappush

from bridge.drives.interface import DriveNode
from bridge.frame import Frame
from bridge.frame_faults import FrameFaults
from plant.disturbance import Disturbance
from plant.robot import EmulatedRobot

_Held = list[tuple[int, int, Frame]]


class Interference:
    """What acts on one ideal bus with the drives of these robots."""

    __slots__ = (
        "_cut",
        "_faults",
        "_from_drives",
        "_number",
        "_robots",
        "_silent",
        "_to_drives",
        "acts",
    )

    def __init__(self, robots: Sequence[EmulatedRobot]) -> None:
        self._robots = robots
        self._cut = False  # all drives are cut off
        self._faults = FrameFaults()
        self._silent: list[DriveNode] = []
        self._from_drives: _Held = []
        self._to_drives: _Held = []
        self._number = 0
        self.acts = False
        """Whether a fault acts, or a frame is held back; only then the methods need be called."""

    def disturb(self, disturbance: Disturbance) -> None:
        """Let this act from now on."""
        self._faults.replace(disturbance.frames)
        self._cut = all(robot in disturbance.cut for robot in self._robots)
        cut = [drive for robot in disturbance.cut for drive in robot.drives]
        self._silent = [*disturbance.silent, *cut]
        self._look()

    def frames_due(self, now_ns: int) -> list[Frame]:
        """What drives send at an instant, and arrives."""
        frames: list[Frame] = []
        for robot in self._robots:
            robot.update_encoders()
            for drive in robot.drives:
                said = drive.due(now_ns)
                if not self._is_silent(drive):
                    frames += said
        return self.from_drives(sorted(frames), now_ns)

    def from_drives(self, frames: Sequence[Frame], now_ns: int) -> list[Frame]:
        """What arrives at clients of frames that drives sent, and of those held back."""
        return self._pass(frames, self._from_drives, now_ns, of_drive=True)

    def to_drives(self, frames: Sequence[Frame], now_ns: int) -> list[Frame]:
        """What arrives at drives of frames that clients sent, and of those held back."""
        sent = () if self._cut else frames
        return self._pass(sent, self._to_drives, now_ns, of_drive=False)

    def react(self, frames: Sequence[Frame], now_ns: int) -> list[Frame]:
        """Let the drives that hear them process frames; return their replies."""
        return [
            reply
            for robot in self._robots
            for frame in frames
            for drive in robot.drives
            if not self._is_silent(drive)
            for reply in drive.on_frame(frame, now_ns)
        ]

    def _is_silent(self, drive: DriveNode) -> bool:
        """Whether a drive says and hears nothing."""
        return any(drive is silent for silent in self._silent)

    def _pass(
        self, frames: Sequence[Frame], held: _Held, now_ns: int, *, of_drive: bool
    ) -> list[Frame]:
        passing: list[Frame] = []
        while held and held[0][0] <= now_ns:
            passing.append(heappop(held)[2])
        for frame in frames:
            found = self._faults.take(frame, of_drive=of_drive)
            if found is None:
                passing.append(frame)
            elif found.kind == "can_duplicate":
                passing += (frame, frame)
            elif found.kind == "can_delay":
                self._number += 1
                heappush(held, (now_ns + found.delay_ns, self._number, frame))
        self._look()
        return passing

    def _look(self) -> None:
        self.acts = bool(
            self._faults.acting or self._silent or self._from_drives or self._to_drives
        )
