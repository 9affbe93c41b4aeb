"""Load and worst-case response times of the periodic messages of a bus.

    U = Σ C_m / T_m                                                                             (1)
    R_m = max over q of  w_m(q) − q T_m + C_m,      q = 0 .. ⌈t_m / T_m⌉ − 1                    (2)
    w_m(q) = B_m + q C_m + Σ_{k ∈ hp(m)} ⌈(w_m(q) + τ) / T_k⌉ C_k                               (3)
    t_m = B_m + Σ_{k ∈ hep(m)} ⌈t_m / T_k⌉ C_k                                                  (4)

    C_m   longest a frame of m can be, intermission included     [ns]
    T_m   its period; τ is one bit                               [ns]
    B_m   longest frame of lower priority, which can't be stopped [ns]
    hp(m) messages of higher priority; hep(m) those and m itself

Davis, Burns, Bril, Lukkien: "Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised", Real-Time Systems 35 (2007). Exact for messages that are queued by priority,
without jitter, error frames or offsets: a bound that holds whenever they are due. A message is
schedulable if its R is no more than its period. Above a load of 1 there is no bound.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from bridge.frame import EFF, RTR
from bridge.wire.bits import arbitration_key, most_bits

_SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Message:
    """A periodic message; `can_id` is SocketCAN's, with flags."""

    can_id: int
    length: int  # bytes
    period_ns: int
    mean_bits: float = 0.0  # as it usually is; 0: as long as it can be

    @property
    def worst_bits(self) -> int:
        """The most bits that a frame of it can have."""
        length = 0 if self.can_id & RTR else self.length
        return most_bits(length, extended=bool(self.can_id & EFF))


@dataclass(frozen=True, slots=True)
class Response:
    """How long a message takes at worst, from being due to the end of its frame."""

    can_id: int
    period_ns: int
    response_ns: int | None  # None: no bound, the bus is overloaded
    usual_ns: int | None  # the same with all frames of mean length

    @property
    def schedulable(self) -> bool:
        """Whether it is always sent before it is due again."""
        return self.response_ns is not None and self.response_ns <= self.period_ns

    @property
    def usually_schedulable(self) -> bool:
        """The same for frames of mean length, still all due at once."""
        return self.usual_ns is not None and self.usual_ns <= self.period_ns


@dataclass(frozen=True, slots=True)
class Analysis:
    """What can be said of a bus; loads are shares of its time, above 1 is more than it can take."""

    mean_load: float
    worst_load: float
    messages: tuple[Response, ...]  # by priority, highest first

    @property
    def schedulable(self) -> bool:
        """Whether every message is always sent before it is due again."""
        return all(message.schedulable for message in self.messages)

    @property
    def slowest(self) -> Response:
        """The message whose worst case is the largest part of its period."""
        return max(self.messages, key=_tightness)


def analyse(messages: Sequence[Message], bitrate_bit_s: int) -> Analysis:
    """Load and worst-case response times of all that share a bus.

    Raises:
        ValueError: no messages, or two with the same identifier, which no bus may have.
    """
    ranked = sorted(messages, key=lambda message: arbitration_key(message.can_id))
    for n, message in enumerate(ranked[1:]):
        if message.can_id == ranked[n].can_id:
            raise ValueError(f"two messages have the identifier 0x{message.can_id:X}")
    if not ranked:
        raise ValueError("no messages: nothing to analyse")
    costs = [_span(message.worst_bits, bitrate_bit_s) for message in ranked]
    periods = [message.period_ns for message in ranked]
    usual = [_span(message.mean_bits or message.worst_bits, bitrate_bit_s) for message in ranked]
    tau = _span(1, bitrate_bit_s)
    return Analysis(
        sum(cost / period for cost, period in zip(usual, periods, strict=True)),
        sum(cost / period for cost, period in zip(costs, periods, strict=True)),
        tuple(
            Response(
                message.can_id,
                message.period_ns,
                _response(n, costs, periods, tau),
                _response(n, usual, periods, tau),
            )
            for n, message in enumerate(ranked)
        ),
    )


def _response(m: int, costs: Sequence[int], periods: Sequence[int], tau: int) -> int | None:
    """(2) of the message with rank m; None when what is as urgent fills the bus."""
    hep = range(m + 1)
    if sum(costs[k] / periods[k] for k in hep) >= 1:
        return None
    blocking = max(costs[m + 1 :], default=0)
    busy = costs[m]
    while (longer := blocking + sum(-(-busy // periods[k]) * costs[k] for k in hep)) != busy:
        busy = longer
    worst = 0
    for q in range(-(-busy // periods[m])):
        wait = blocking + q * costs[m]
        while (
            longer := blocking
            + q * costs[m]
            + sum(-(-(wait + tau) // periods[k]) * costs[k] for k in range(m))
        ) != wait:
            wait = longer
        worst = max(worst, wait - q * periods[m] + costs[m])
    return worst


def _tightness(message: Response) -> float:
    if message.response_ns is None:
        return float("inf")
    return message.response_ns / message.period_ns


def _span(bits: float, bitrate_bit_s: int) -> int:
    return ceil(bits * _SECOND_NS / bitrate_bit_s)
