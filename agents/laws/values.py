"""What a law is told at a tick, and what it brings: numbers with names.

They come in order as well: `x, y, theta, v, omega = motion`. They don't change.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Final


class Values(ABC):
    """Values with names, equal where all of them are."""

    __slots__ = ()

    @abstractmethod
    def in_order(self) -> tuple[Any, ...]:
        """All values, in the order of the constructor's arguments."""

    def __iter__(self) -> Iterator[Any]:
        return iter(self.in_order())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Values) or type(other) is not type(self):
            return NotImplemented
        return self.in_order() == other.in_order()

    def __hash__(self) -> int:
        return hash(self.in_order())

    def __reduce__(self) -> tuple[type[Any], tuple[Any, ...]]:
        return type(self), self.in_order()

    def __repr__(self) -> str:
        return f"{type(self).__name__}{self.in_order()!r}"


class RobotMotion(Values):
    """The motion of the robot, as its controller measures it."""

    __slots__ = ("omega", "theta", "v", "x", "y")

    def __init__(self, x: float, y: float, theta: float, v: float, omega: float) -> None:
        self.x: Final = x  # [m], world
        self.y: Final = y  # [m], world
        self.theta: Final = theta  # [rad], counter-clockwise from world x, not wrapped
        self.v: Final = v  # [m/s], forward
        self.omega: Final = omega  # [rad/s]

    def in_order(self) -> tuple[float, float, float, float, float]:
        """All values, in the order of the constructor's arguments."""
        return self.x, self.y, self.theta, self.v, self.omega


class Reference(Values):
    """The path at one s."""

    __slots__ = ("omega_bar", "theta", "v_bar", "x", "y")

    def __init__(self, x: float, y: float, theta: float, v_bar: float, omega_bar: float) -> None:
        self.x: Final = x  # [m], world
        self.y: Final = y  # [m], world
        self.theta: Final = theta  # [rad], in (−π, π]
        self.v_bar: Final = v_bar  # (10) [m per unit of s]
        self.omega_bar: Final = omega_bar  # (11) [rad per unit of s]

    def in_order(self) -> tuple[float, float, float, float, float]:
        """All values, in the order of the constructor's arguments."""
        return self.x, self.y, self.theta, self.v_bar, self.omega_bar


class PathVariable(Values):
    """The path variable of the robot, from the coordination (40), (45)."""

    __slots__ = ("s", "s_ddot", "s_dot")

    def __init__(self, s: float, s_dot: float, s_ddot: float) -> None:
        self.s: Final = s  # [m]
        self.s_dot: Final = s_dot  # [m/s], μ + v̂_r
        self.s_ddot: Final = s_ddot  # [m/s²], mean of the coming period

    def in_order(self) -> tuple[float, float, float]:
        """All values, in the order of the constructor's arguments."""
        return self.s, self.s_dot, self.s_ddot


class LawOutput(Values):
    """One step of a law."""

    __slots__ = ("signals", "state", "tau_left", "tau_right")

    def __init__(
        self, tau_right: float, tau_left: float, state: Any, signals: Sequence[float]
    ) -> None:
        self.tau_right: Final = tau_right  # [N·m] at the wheel
        self.tau_left: Final = tau_left  # [N·m] at the wheel
        self.state: Final = state  # at the next tick
        self.signals: Final = signals  # the values of SIGNALS, in their order

    def in_order(self) -> tuple[float, float, Any, Sequence[float]]:
        """All values, in the order of the constructor's arguments."""
        return self.tau_right, self.tau_left, self.state, self.signals
