"""Delays of messages: one number per message, from the distribution of the edge."""

from collections.abc import Callable, Iterator
from itertools import cycle
from math import log, sqrt
from random import Random

from configs.netem import (
    MOST_DELAY_NS,
    ConstantDelay,
    Delay,
    LognormalDelay,
    NormalDelay,
    TraceDelay,
    UniformDelay,
)

Draw = Callable[[], int | None]
"""The delay of the next message [ns]; None: it is lost."""


def delay_draw(delay: Delay | None, random: Random) -> Draw:
    """The draw of an edge's delays, in the order in which its messages are sent."""
    match delay:
        case None:
            return lambda: 0
        case ConstantDelay():
            constant_ns = round(delay.delay_s * 1e9)
            return lambda: constant_ns
        case UniformDelay():
            low_s, high_s = delay.min_s, delay.max_s
            return lambda: round(random.uniform(low_s, high_s) * 1e9)
        case NormalDelay():
            mean_s, std_s = delay.mean_s, delay.std_s
            return lambda: _bounded(random.normalvariate(mean_s, std_s))
        case LognormalDelay():
            mu, sigma = lognormal_parameters(delay.mean_s, delay.std_s)
            return lambda: _bounded(random.lognormvariate(mu, sigma))
        case TraceDelay():
            return _following(cycle(delay.delays_s))


def lognormal_parameters(mean_s: float, std_s: float) -> tuple[float, float]:
    """(μ, σ) of the logarithm [ln s] of a lognormal delay with this mean and deviation [s]."""
    variance = log(1.0 + (std_s / mean_s) ** 2)
    return log(mean_s) - 0.5 * variance, sqrt(variance)


def _bounded(delay_s: float) -> int:
    return min(max(round(delay_s * 1e9), 0), MOST_DELAY_NS)


def _following(delays_s: Iterator[float]) -> Draw:
    def draw() -> int | None:
        delay_s = next(delays_s)
        return None if delay_s < 0.0 else round(delay_s * 1e9)

    return draw
