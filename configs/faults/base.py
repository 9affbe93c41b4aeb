"""What all faults have in common, and a fault as a process receives it."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from annotated_types import Len

from configs.errors import KeyValueError
from configs.parameters import Name, Parameters, Seconds, SecondsOrZero, parameter

Place = Literal["plant", "agent", "process"]
Model = Literal["powertrain", "wire"]
Side = Literal["right", "left", "both"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault(Parameters):
    """What all faults have."""

    PLACE: ClassVar[Place] = "plant"
    INSTANT: ClassVar[bool] = False
    """Whether it happens at a tick, and has no end."""
    NEEDS: ClassVar[frozenset[Model]] = frozenset()
    """Models without which it has no effect."""
    NOTHING: ClassVar[Mapping[str, float]] = {}
    """Values of parameters with which, all together, it changes nothing."""

    kind: str
    name: Name | None = parameter(None, "KIND, or KIND_2 and so on, if not given")
    at_s: SecondsOrZero
    for_s: Seconds | None = parameter(None, "to the end if not given")

    def __post_init__(self) -> None:
        """Refuse a duration where there is none, and what changes nothing."""
        if self.INSTANT and self.for_s is not None:
            raise KeyValueError("for_s", f"{self.kind} happens at an instant: leave it out")
        if self.NOTHING and all(getattr(self, key) == it for key, it in self.NOTHING.items()):
            values = " and ".join(f"{key} = {it:g}" for key, it in self.NOTHING.items())
            raise KeyValueError(next(iter(self.NOTHING)), f"changes nothing with {values}")

    @property
    def parameters(self) -> dict[str, Any]:
        """What the kind adds to the keys of all faults."""
        common = {*Fault.__dataclass_fields__, "robots"}
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name not in common}


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotFault(Fault):
    """A fault of robots."""

    robots: Annotated[tuple[str, ...], Len(1)] | None = parameter(None, "all if not given")


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelFault(RobotFault):
    """A fault behind wheels of robots."""

    wheel: Side = "both"


class PlannedFault(NamedTuple):
    """A fault as it acts on one target: from a tick on, and until one."""

    name: str
    target: str  # a robot; of a link its edge, as "r1 -> r2"
    fault: Fault
    from_tick: int
    to_tick: int | None  # the first tick at which it acts no more; None: it has no end
