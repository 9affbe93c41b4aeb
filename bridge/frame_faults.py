"""Faults of frames on one bus: which of them applies to a frame. Pure.

    kind            on a wire, where                             on an ideal bus, at the drives' end
    can_drop        before its sender's controller: never sent   lost
    can_duplicate   the same: queued twice                       passes twice
    can_delay       the same: queued later                       passes later
    can_corrupt     on the wire: destroyed, and sent again       -

One fault applies to a frame, the one that began first; on a wire another may corrupt it then.
Identifiers are compared without their flags: a remote frame matches as the data frame does. Error
frames match no fault.
"""

from collections.abc import Callable, Iterable

from bridge.frame import ERR, ID_MASK_29, Frame
from configs.faults.buses import FrameCorruption, FrameDelay, FrameFault

Concerns = Callable[[Frame], bool]
"""Whether a frame concerns a robot."""


class ActingFrameFault:
    """A fault of frames as it acts on one bus.

    Args:
        fault: as the scenario has it.
        concerns: the frames of its robot, where a bus carries others as well; None: all are.
    """

    __slots__ = ("_concerns", "_passes", "can_id", "delay_ns", "kind", "left", "on_wire")

    def __init__(self, fault: FrameFault, concerns: Concerns | None = None) -> None:
        self.kind = fault.kind
        self.can_id = fault.can_id
        self.left = fault.count
        """Frames that it still applies to; None: all while it acts."""
        self.on_wire = isinstance(fault, FrameCorruption)
        self.delay_ns = round(fault.delay_s * 1e9) if isinstance(fault, FrameDelay) else 0
        passing = {"to_drives": True, "from_drives": False, "both": None}
        self._passes = passing[fault.direction]  # whether drives' frames do; None: none pass
        self._concerns = concerns

    def matches(self, frame: Frame, *, of_drive: bool) -> bool:
        """Whether it applies to a frame of a drive or of a host."""
        can_id = frame.can_id
        return (
            self._passes is not of_drive
            and self.can_id in (None, can_id & ID_MASK_29)
            and not can_id & ERR
            and (self._concerns is None or self._concerns(frame))
        )


class FrameFaults:
    """The faults of frames that act on one bus, in the order in which they began."""

    __slots__ = ("acting",)

    def __init__(self) -> None:
        self.acting: list[ActingFrameFault] = []
        """The same list for good: empty while no fault acts."""

    def replace(self, faults: Iterable[ActingFrameFault]) -> None:
        """Let these act from now on, less those that have applied to all their frames."""
        self.acting[:] = [fault for fault in faults if fault.left != 0]

    def take(self, frame: Frame, *, of_drive: bool) -> ActingFrameFault | None:
        """The fault that applies to a frame on its way to the bus, counted; None: none does."""
        fault = self.match(frame, of_drive=of_drive, on_wire=False)
        if fault is not None:
            self.count(fault)
        return fault

    def match(self, frame: Frame, *, of_drive: bool, on_wire: bool) -> ActingFrameFault | None:
        """The fault that applies to a frame, on the wire or before it; None: none does."""
        for fault in self.acting:
            if fault.on_wire is on_wire and fault.matches(frame, of_drive=of_drive):
                return fault
        return None

    def count(self, fault: ActingFrameFault) -> None:
        """A fault has applied to one more frame."""
        if fault.left is not None:
            fault.left -= 1
            if fault.left <= 0 and fault in self.acting:
                self.acting.remove(fault)
