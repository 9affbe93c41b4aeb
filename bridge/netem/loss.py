"""Losses of messages: whether the next message of an edge is lost."""

from collections.abc import Callable
from random import Random

from configs.netem import BernoulliLoss, DistanceLoss, GilbertElliottLoss, Loss

Draw = Callable[[], bool]
"""Whether the next message is lost."""


def loss_draw(loss: Loss | None, random: Random) -> Draw:
    """The draw of an edge's losses, in the order in which its messages are sent."""
    match loss:
        case None:
            return lambda: False
        case BernoulliLoss():
            probability = loss.probability
            return lambda: random.random() < probability
        case GilbertElliottLoss():
            return _GilbertElliott(loss, random)


def distance_draw(loss: DistanceLoss | None, random: Random) -> Callable[[float], bool]:
    """The draw of an edge's losses by distance [m], in the order in which messages are sent."""
    if loss is None:
        return lambda _: False
    range_m, exponent = loss.range_m, loss.exponent

    def draw(distance_m: float) -> bool:
        chance = random.random()
        if distance_m >= range_m:
            return True
        return exponent is not None and chance < (distance_m / range_m) ** exponent

    return draw


class _GilbertElliott:
    """A Markov chain of two states that takes one step per message, begun in its stationary law."""

    __slots__ = ("_bad", "_loss", "_random")

    def __init__(self, loss: GilbertElliottLoss, random: Random) -> None:
        self._loss = loss
        self._random = random.random
        bad_share = loss.good_to_bad / (loss.good_to_bad + loss.bad_to_good)
        self._bad = random.random() < bad_share

    def __call__(self) -> bool:
        loss, draw = self._loss, self._random
        lost = draw() < (loss.loss_in_bad if self._bad else loss.loss_in_good)
        change = draw() < (loss.bad_to_good if self._bad else loss.good_to_bad)
        self._bad ^= change
        return lost
