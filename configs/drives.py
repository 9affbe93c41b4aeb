"""Section [drive]: the keys that every drive protocol has; and the protocols, by name.

odrive            shipped: a row of `DRIVES`
my_drive:ROW      the value ROW of my_drive.py (or of the package my_drive) beside the scenario
                  file, else on sys.path: a `bridge.drives.interface.DriveProtocol`

The section of a protocol derives from `Drive`: in the file its keys stand beside the shared ones.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

from configs.parameters import Node, Parameters, Positive, Seconds, SecondsOrZero, parameter

if TYPE_CHECKING:
    from configs.errors import Problem
    from configs.host import Host
    from configs.sections import Clock

DRIVES: Mapping[str, str] = {"odrive": "bridge.drives.odrive:ODRIVE"}
"""The protocols that are shipped: where each one's row is."""
DEFAULT = "odrive"


class VelocityLimit(NamedTuple):
    """A drive's limit of speed in torque mode: at the shaft |τ| ≤ gain × (limit − |speed|)."""

    key: str  # of [drive] that sets it
    limit_shaft_rev_s: float
    gain_shaft_N_m_s_rev: float


class Derating(NamedTuple):
    """Temperatures between which a drive takes its current limit linearly to 0."""

    from_C: float
    to_C: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive(Parameters):
    """The drives, two per robot.

    The methods are a protocol's to override: what checks know of it.
    """

    preset: Literal["ideal", "limited", "realistic"] = parameter(
        "ideal",
        "ideal: torque as commanded; limited: with the limits of the drive; realistic: these,"
        " and [motor], [encoder], [supply]",
    )
    right_node: Node = 0
    left_node: Node = 1
    encoder_period_s: Seconds | None = parameter(
        None,
        "of encoder frames, at most one control period, which it is if not given;"
        " in lockstep on ideal buses they come with the ticks",
    )
    command_latency_s: tuple[SecondsOrZero, SecondsOrZero] = parameter(
        (0.0001, 0.0011),
        "least and most from the end of a frame until firmware acts on it; preset"
        " realistic on buses with bit timing",
    )
    torque_constant_N_m_A: Positive = 0.05
    current_limit_A: Positive = 10.0

    def problems(self, clock: "Clock", host: "Host") -> Iterator["Problem"]:  # noqa: ARG002
        """Problems of the protocol's own keys with each other, with [clock] and with [host]."""
        return iter(())

    def errors(self) -> tuple[str, ...]:
        """Names of the errors with which an emulated drive can disarm; the first by default."""
        return ()

    def fault_problem(self, kind: str) -> str | None:
        """The reason why an emulated drive can't have a fault of this kind, None if it can.

        Of the kinds of `configs.faults.powertrains.DriveFault`: those that a protocol can have its
        emulated drive has methods for.
        """
        return f"the emulated drives of this protocol have no {kind}"

    def velocity_limit(self) -> VelocityLimit | None:
        """The limit of speed in torque mode, None if there is none; not of the preset ideal."""
        return None

    def derating(self) -> Derating | None:
        """The temperatures of derating, None if drives don't derate."""
        return None
