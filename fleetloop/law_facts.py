"""What a law tells of itself, by its class and its gains: `agents.laws.interface.Law`.

A law offers what its class defines itself or has from a class other than `Law`. What it doesn't
offer, or raises when it is asked, is unknown here.
"""

from math import inf
from typing import Any, NamedTuple

from agents.laws.failure import number, raised
from agents.laws.interface import AdaptationLimit, Law
from configs.plugins import Choice


class Told(NamedTuple):
    """The answer of a law."""

    value: Any = None
    trouble: str = ""
    """The error that it raised instead."""


def offers(control: Choice, name: str) -> bool:
    """Whether a law has a method of `Law` other than its default."""
    found = getattr(control.load(), name, None)
    return found is not None and getattr(found, "__func__", found) is not _default(name)


def torque_limit_wheel_N_m(control: Choice) -> float:
    """The law's own limit of a wheel's torque; infinite if it has none."""
    limit: float | None = asked(control, "torque_limit_wheel_N_m").value
    return inf if limit is None else limit


def approach_rate_1_s(control: Choice) -> float | None:
    """The rate at which it closes an error along the path; None if unknown."""
    rate: float | None = asked(control, "approach_rate_1_s").value
    return rate


def lateral_gain_1_m(control: Choice) -> float | None:
    """The part of an error across the path that it closes per distance ahead; None if unknown."""
    gain: float | None = asked(control, "lateral_gain_1_m").value
    return gain


def reverses(control: Choice) -> bool:
    """Whether it follows its path backwards as well; not if unknown."""
    return bool(getattr(control.load(), "REVERSES", False))


def speed_gain(control: Choice) -> float | None:
    """Gain of its speed loop, as k_4 of (34); None if unknown."""
    gain: float | None = asked(control, "speed_gain_N_m_s").value
    return gain


def speed_gain_key(control: Choice) -> str:
    """The name of the gain that sets `speed_gain`; "" if unknown."""
    name: str = getattr(control.load(), "SPEED_GAIN", "")
    return name if hasattr(control.parameters, name or " ") else ""


def loop_gains(law: type[Law], gains: Any) -> tuple[str, ...]:
    """Names of the gains that shape its loop near the path, the first to lower first."""
    return tuple(name for name in getattr(law, "LOOP_GAINS", ()) if hasattr(gains, name))


def saturation(control: Choice) -> str:
    """What limits of the drives do to it, and what to do; "" if it isn't harmed, or unknown."""
    words: str = getattr(control.load(), "SATURATION", "")
    return words


def adaptation_limit(control: Choice, period_s: float) -> AdaptationLimit | None:
    """The limit of its sampled adaptation; None if it has none, or unknown."""
    limit: AdaptationLimit | None = asked(control, "adaptation_limit", period_s).value
    return limit


def asked(control: Choice, name: str, period_s: float = 0.0) -> Told:
    """What a law says of itself with its gains; a number, but of its adaptation."""
    if not offers(control, name):
        return Told()
    ask = getattr(control.load(), name)
    try:
        if name == "adaptation_limit":
            return Told(ask(control.parameters, period_s))
        answer = ask(control.parameters)
        return Told(None if answer is None else number(answer))
    except (Exception, SystemExit) as error:
        return Told(trouble=raised(error))


def _default(name: str) -> Any:
    method = getattr(Law, name)
    return getattr(method, "__func__", method)
