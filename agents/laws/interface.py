"""The interface between the controller and its law: what a law is told, and what it brings.

    brings      Gains     its parameters: a frozen dataclass, bounds and units in its fields
                SIGNALS   names, units and meanings of what it says of every tick
                step      measured motion, reference and path variable -> wheel torques, next state
                hold      the next state after a tick whose torque did not reach the wheels whole

A law is built once per robot and called once per control period. Its state is its own: the
controller keeps it, gives it back at the next tick, and looks at nothing in it. It is None at the
first tick, and at the first one after the robot armed again.

A law may raise, and may return torques that are not finite: the robot then stops.
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import Any, ClassVar, NamedTuple, Protocol

from configs.brief import Wheels
from configs.parameters import Parameters
from configs.signals import PATH_ERRORS, Signal

__all__ = [
    "PATH_ERRORS",
    "Law",
    "LawOutput",
    "Parameters",
    "PathVariable",
    "Reference",
    "RobotMotion",
    "RobotPath",
    "Signal",
    "Wheels",
]


class RobotMotion(NamedTuple):
    """The motion of the robot, as its controller measures it."""

    x: float  # [m], world
    y: float  # [m], world
    theta: float  # [rad], counter-clockwise from world x, not wrapped
    v: float  # [m/s], forward
    omega: float  # [rad/s]


class Reference(NamedTuple):
    """The path at one s."""

    x: float  # [m], world
    y: float  # [m], world
    theta: float  # [rad], in (−π, π]
    v_bar: float  # (10) [m per unit of s]
    omega_bar: float  # (11) [rad per unit of s]


class PathVariable(NamedTuple):
    """The path variable of the robot, from the coordination (40), (45)."""

    s: float  # [m]
    s_dot: float  # [m/s], μ + v̂_r
    s_ddot: float  # [m/s²], mean of the coming period


RobotPath = Callable[[float], Reference]
"""s ↦ the robot's own reference Γ_i(s), its offset included."""


class LawOutput(NamedTuple):
    """One step of a law."""

    tau_right: float  # [N·m] at the wheel
    tau_left: float  # [N·m] at the wheel
    state: Any  # at the next tick
    signals: Sequence[float]  # the values of SIGNALS, in their order


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

    # What `fleetloop check` asks; None or infinite: unknown, and that check is left out.

    @classmethod
    def torque_limit_wheel_N_m(cls, gains: Any) -> float:  # noqa: ARG003
        """The law's own limit of a wheel's torque [N·m]."""
        return inf

    @classmethod
    def approach_rate_1_s(cls, gains: Any) -> float | None:  # noqa: ARG003
        """The rate at which an error along the path is closed [1/s]."""
        return None

    @classmethod
    def speed_gain_N_m_s(cls, gains: Any) -> float | None:  # noqa: ARG003
        """Gain of the speed loop, in the units of u in (34) per m/s and rad/s."""
        return None
