"""The interface between the controller and its law: what a law is told, and what it brings.

    brings      Gains     its parameters: a frozen dataclass, bounds and units in its fields
                SIGNALS   names, units and meanings of what it says of every tick
                step      measured motion, reference and path variable -> wheel torques, next state
                hold      the next state after a tick whose torque did not reach the wheels whole

A law is built once per robot and called once per control period. Its state is its own: the
controller keeps it, gives it back at the next tick, and looks at nothing in it. It is None at the
first tick, and at the first one after the robot armed again.

A law may raise, and may return torques that are not finite: the robot then stops.

For `fleetloop check` a law may tell of itself what follows from its equations: limits, gains, and
its part of the sampled loop near the path (`LoopElement`).
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import Any, ClassVar, NamedTuple, Protocol

from agents.laws.values import LawOutput, PathVariable, Reference, RobotMotion
from configs.brief import Wheels
from configs.parameters import Parameters
from configs.signals import PATH_ERRORS, Signal

__all__ = [
    "PATH_ERRORS",
    "AdaptationLimit",
    "Fast",
    "Law",
    "LawOutput",
    "LoopElement",
    "Parameters",
    "PathVariable",
    "Reference",
    "RobotMotion",
    "RobotPath",
    "Signal",
    "Theta",
    "Wheels",
]


RobotPath = Callable[[float], Reference]
"""s ↦ the robot's own reference Γ_i(s), its offset included."""


Theta = tuple[float, float, float, float, float, float, float, float]
"""Θ of (32), (4) of one robot: c b, d̄_11, d̄_12, m̄_1, c/b, d̄_21, d̄_22, m̄_2 [kg·m², N·m·s]."""

Fast = tuple[float, ...]
"""Fast states of a law: those that take part in the loop, without what adapts."""


class LoopElement(NamedTuple):
    """A law in steady motion along its path, as an element of the sampled loop.

    What adapts is held still, and limits don't act: the loop is linearised about `steady`.
    """

    steady: Fast
    """The fast states in steady motion; () of a law without any."""
    step: Callable[[Fast, RobotMotion, Reference, PathVariable], tuple[float, float, Fast]]
    """Fast states of a tick -> torques at the right and left wheel [N·m], fast states after it."""
    states: str = ""
    """The fast states in words, such as "filters"."""
    time_constants_s: tuple[float, ...] = ()
    """Lags of the fast states [s]."""


class AdaptationLimit(NamedTuple):
    """The condition under which sampled adaptation is stable: ratio < 1."""

    condition: str
    """In symbols, with the number of its equation."""
    unit: str
    """The right side of the condition: the ratio's unit."""
    remedy: str
    """What to change where the condition doesn't hold."""
    ratio: Callable[[Any, Any, RobotMotion], float]
    """The law's states before and after a tick, and its motion -> left side over right side."""


class Law(Protocol):
    """A control law. Deriving from it is optional and brings the defaults below.

    Args:
        gains: of the type `Gains`, validated.
        wheels: radius r and half track b (Assumption 2.3).
        period_s: the control period h [s].
        path: the robot's reference path, for a law that looks beyond the present s.
    """

    Gains: ClassVar[type[Parameters]]
    SIGNALS: ClassVar[tuple[Signal, ...]] = ()
    """A table that has `PATH_ERRORS` in it gives these itself; else the controller adds them."""

    def __init__(self, gains: Any, wheels: Wheels, period_s: float, path: RobotPath) -> None: ...

    def step(
        self, state: Any, motion: RobotMotion, reference: Reference, along: PathVariable
    ) -> LawOutput:
        """Torques of one tick, the state at the next tick, and the values of `SIGNALS`."""
        ...

    def hold(self, before: Any, after: Any) -> Any:  # noqa: ARG002 - of this law, nothing
        """The next state when the torque did not reach the wheels as asked: limited by the host.

        What a law learns from such a tick is the limit. `before` is None at the first tick.
        """
        return after

    # What `fleetloop check` asks. A law offers what its class defines; check names what it doesn't.

    SPEED_GAIN: ClassVar[str] = ""
    """The name in `Gains` of the gain to which `speed_gain_N_m_s` is proportional."""
    LOOP_GAINS: ClassVar[tuple[str, ...]] = ()
    """Names in `Gains` of those that shape the loop near the path, the first to lower first."""
    SATURATION: ClassVar[str] = ""
    """What limits of the drives do to the law, and what to do; "" if it isn't harmed."""

    @classmethod
    def torque_limit_wheel_N_m(cls, gains: Any) -> float:  # noqa: ARG003
        """The law's own limit of a wheel's torque [N·m]; infinite if it has none."""
        return inf

    @classmethod
    def approach_rate_1_s(cls, gains: Any) -> float | None:  # noqa: ARG003
        """The rate at which an error along the path is closed [1/s]."""
        return None

    @classmethod
    def lateral_gain_1_m(cls, gains: Any) -> float | None:  # noqa: ARG003
        """The part of an error across the path that is closed per distance ahead [1/m], as (18)."""
        return None

    REVERSES: ClassVar[bool] = False
    """Whether an error across the path is closed as well where ṡ < 0, driving backwards."""

    @classmethod
    def speed_gain_N_m_s(cls, gains: Any) -> float | None:  # noqa: ARG003
        """Gain of the speed loop, in the units of u in (34) per m/s and rad/s."""
        return None

    @classmethod
    def loop_elements(
        cls,
        gains: Any,  # noqa: ARG003
        wheels: Wheels,  # noqa: ARG003
        period_s: float,  # noqa: ARG003
        path: RobotPath,  # noqa: ARG003
        along: PathVariable,  # noqa: ARG003
        theta: Theta,  # noqa: ARG003
    ) -> Sequence[LoopElement] | None:
        """The law near `path`, a line or an arc, in steady motion of the speed of `along`.

        `theta` are the robot's true parameters. The first element has what adapts at its start
        values; of a law that adapts, the last one has it where it may end up.
        """
        return None

    @classmethod
    def adaptation_limit(cls, gains: Any, period_s: float) -> AdaptationLimit | None:  # noqa: ARG003
        """The limit of the sampled adaptation; None: it has none, or nothing adapts."""
        return None
