"""Faults of frames on a wire, without a scenario."""

from typing import cast

from bridge.frame_faults import ActingFrameFault
from bridge.wire.wire import Wire
from configs.faults.buses import FrameFault
from configs.faults.kinds import KINDS


def frame_fault(kind: str, **keys: object) -> ActingFrameFault:
    """A fault of this kind as it acts."""
    return ActingFrameFault(cast("FrameFault", KINDS[kind](kind=kind, at_s=0.0, **keys)))


def inject(wire: Wire, *faults: ActingFrameFault) -> None:
    """Let these act beside those that do."""
    wire.faults.replace([*wire.faults.acting, *faults])
    wire.revise()


def clear(wire: Wire) -> None:
    """Let no fault act."""
    wire.faults.replace(())
    wire.revise()
