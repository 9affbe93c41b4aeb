"""Optional properties of a law that checks use, and whether it is of the paper's kind."""

from math import inf
from typing import Any

from agents.laws.adaptive_dsc import AdaptiveDsc
from agents.laws.adaptive_dsc_robust import AdaptiveDscRobust
from agents.laws.dsc_terms import SurfaceGains
from configs.plugins import Choice


def torque_limit_wheel_N_m(control: Choice) -> float:
    """The law's own limit of a wheel's torque; infinite if it has none."""
    limit = _told(control, "torque_limit_wheel_N_m")
    return inf if limit is None else float(limit)


def approach_rate_1_s(control: Choice) -> float | None:
    """The rate at which it closes an error along the path; None if unknown."""
    rate: float | None = _told(control, "approach_rate_1_s")
    return rate


def speed_gain(control: Choice) -> float | None:
    """Gain of its speed loop, as k_4 of (34); None if unknown."""
    gain: float | None = _told(control, "speed_gain_N_m_s")
    return gain


def is_adaptive_dsc(control: Choice) -> bool:
    """Whether it is the paper's law or derived from it: its state and gains are known."""
    found = control.load()
    return (
        isinstance(found, type)
        and issubclass(found, AdaptiveDsc)
        and hasattr(control.parameters, "k5")
    )


def normalises(control: Choice) -> bool:
    """Whether its adaptation is normalised and holds still at a limit."""
    return issubclass(control.load(), AdaptiveDscRobust)


def lateral_gain_1_m(control: Choice) -> float | None:
    """k_2 of (17), of the dynamic surface laws; None of others."""
    gains = control.parameters
    return gains.k2 if isinstance(gains, SurfaceGains) else None


def _told(control: Choice, name: str) -> Any:
    """What a law says of itself with its gains; None if it doesn't."""
    ask = getattr(control.load(), name, None)
    return None if ask is None else ask(control.parameters)
