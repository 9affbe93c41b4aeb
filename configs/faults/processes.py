"""Faults of controllers as processes."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt, Le

from configs.faults.base import Place, RobotFault


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessFault(RobotFault):
    """A fault of controllers as processes; acts in runs over processes."""

    PLACE: ClassVar[Place] = "process"


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessStopped(ProcessFault):
    """Killed, or frozen (SIGSTOP); after `for_s` started again, or awake again."""

    kind: Literal["process_kill", "process_freeze"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessRestart(ProcessFault):
    """Killed and started again at once."""

    INSTANT: ClassVar[bool] = True
    kind: Literal["process_restart"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessSlow(ProcessFault):
    """Every tick takes the controller this much longer, by the wall clock."""

    kind: Literal["process_slow"]
    extra_s: Annotated[float, Gt(0), Le(60)] = 0.002
