"""Section [network]: the effects of the emulated network on messages, per directed edge.

    [network.default]                          every edge between robots
    [[network.edge]]  edges = ["r1 -> r2"]     these; "*" stands for every robot, and a source
                                               may be "leader" or "localisation" as well

What an entry doesn't give is as in the last entry before it that names the edge, at last as in
[network.default]; no effect is the default of all. `bridge.netem` applies them.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from annotated_types import Ge, Gt, Le, Len

from configs.errors import KeyValueError, ScenarioError
from configs.files import text_of
from configs.parameters import (
    MOST,
    Parameters,
    Positive,
    Seconds,
    SecondsOrZero,
    Tagged,
    parameter,
)
from configs.tables import in_words, origin_of

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import core_schema

LOCALISATION = "localisation"
"""The localisation system's name as the source of an edge."""
EVERY_ROBOT = "*"
MOST_DELAY_S = 60.0
MOST_DELAY_NS = 60_000_000_000
LEAST_MEAN_S = 1e-9
"""Of a lognormal delay: scenario time has nanoseconds."""
LEAST_BANDWIDTH_BIT_S = 1.0
MOST_TRACE = 100_000
MOST_TRACE_BYTES = 1 << 22

Delay_s = Annotated[float, Ge(0), Le(MOST_DELAY_S)]
Probability = Annotated[float, Ge(0), Le(1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantDelay(Parameters):
    """Every message takes as long."""

    kind: Literal["constant"]
    delay_s: Delay_s


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformDelay(Parameters):
    """Uniformly distributed between two bounds."""

    kind: Literal["uniform"]
    min_s: Delay_s = 0.0
    max_s: Delay_s

    def __post_init__(self) -> None:
        """Hold the bounds in order."""
        if self.max_s < self.min_s:
            raise KeyValueError("max_s", f"must not be below min_s = {self.min_s:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalDelay(Parameters):
    """Normally distributed; draws below 0 are 0."""

    kind: Literal["normal"]
    mean_s: Delay_s
    std_s: Delay_s


@dataclass(frozen=True, slots=True, kw_only=True)
class LognormalDelay(Parameters):
    """Lognormally distributed, as delays of queues are: few, but long ones. Draws end at 60 s."""

    kind: Literal["lognormal"]
    mean_s: Annotated[float, Ge(LEAST_MEAN_S), Le(MOST_DELAY_S)] = field(
        metadata={"description": "of the delay, not of its logarithm"}
    )
    std_s: Delay_s


@dataclass(frozen=True, slots=True)
class _TraceFile:
    """Annotation of an array of delays that a file may give as the name of a text file."""

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        from pydantic_core import core_schema

        def read(value: Any, info: "core_schema.ValidationInfo") -> Any:
            if not isinstance(value, str):
                return value
            return _delays_of(Path(origin_of(info)[0], value))

        array = handler(source)
        return core_schema.with_info_before_validator_function(
            read,
            array,
            json_schema_input_schema=core_schema.union_schema([array, core_schema.str_schema()]),
        )


def _delays_of(path: Path) -> tuple[float, ...]:
    """The delays of a text file [s], one on a line; `lost` or `nan` is a message that is lost."""
    try:
        text = text_of(path, "the trace", MOST_TRACE_BYTES)
    except ScenarioError as error:
        raise in_words(str(error)) from error
    delays = []
    for number, line in enumerate(text.splitlines(), 1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        try:
            delay_s = LOST_S if text in ("lost", "nan") else float(text)
        except ValueError:
            delay_s = -2.0
        if not (delay_s == LOST_S or 0.0 <= delay_s <= MOST_DELAY_S):
            remedy = f"must be a delay of 0 to {MOST_DELAY_S:g} s, or lost"
            raise in_words(f"{path}, line {number}: {text[:40]!r} {remedy}")
        delays.append(delay_s)
    if not 1 <= len(delays) <= MOST_TRACE:
        raise in_words(f"{path}: has {len(delays)} delays: must be from 1 to {MOST_TRACE}")
    return tuple(delays)


LOST_S = -1.0
"""In a trace: the message is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceDelay(Parameters):
    """Measured delays one after the other, from the beginning again after the last."""

    kind: Literal["trace"]
    delays_s: Annotated[
        tuple[Annotated[float, Ge(LOST_S), Le(MOST_DELAY_S)], ...], Len(1, MOST_TRACE), _TraceFile()
    ] = field(
        metadata={
            "description": "delays, -1 for a message that is lost; or the name of a text file with"
            " one delay on a line (lost: a message that is), beside the scenario"
        }
    )

    def __post_init__(self) -> None:
        """Hold the array to delays and the one mark of a loss."""
        for n, delay_s in enumerate(self.delays_s):
            if LOST_S < delay_s < 0.0:
                remedy = f"must be a delay of 0 to {MOST_DELAY_S:g} s, or {LOST_S:g}: lost"
                raise KeyValueError(f"delays_s.{n}", remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class BernoulliLoss(Parameters):
    """Every message is lost with the same probability."""

    kind: Literal["bernoulli"]
    probability: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class GilbertElliottLoss(Parameters):
    """Losses in bursts: a chain of a good and a bad state, one step per message.

    The mean length of a bad period is 1 / bad_to_good messages, its share good_to_bad /
    (good_to_bad + bad_to_good), with which the chain begins. Gilbert (1960), Elliott (1963).
    """

    kind: Literal["gilbert_elliott"]
    good_to_bad: Probability
    bad_to_good: Annotated[float, Gt(0), Le(1)]
    loss_in_bad: Probability = 1.0
    loss_in_good: Probability = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Partition(Parameters):
    """A cut of the edge: messages sent or due in it are lost."""

    from_s: SecondsOrZero
    to_s: Seconds

    def __post_init__(self) -> None:
        """Hold the times in order."""
        if self.to_s <= self.from_s:
            raise KeyValueError("to_s", f"must be above from_s = {self.from_s:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceLoss(Parameters):
    """Losses by the distance between the two robots: all of them from a range on.

    Below it a message is lost with probability (distance / range)^exponent.
    """

    range_m: Positive
    exponent: Annotated[float, Gt(0), Le(100)] | None = parameter(
        None, "below the range none is lost if not given"
    )


if TYPE_CHECKING:
    Delay = ConstantDelay | UniformDelay | NormalDelay | LognormalDelay | TraceDelay
    Loss = BernoulliLoss | GilbertElliottLoss
else:
    Delay = Annotated[
        ConstantDelay | UniformDelay | NormalDelay | LognormalDelay | TraceDelay, Tagged("kind")
    ]
    Loss = Annotated[BernoulliLoss | GilbertElliottLoss, Tagged("kind")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects(Parameters):
    """Effects of an emulated edge; None: not given, and at last none."""

    delay: Delay | None = parameter(None, "from sending to arrival, in scenario time")
    reordering: bool | None = parameter(
        None, "a message may overtake another (true if not given); else it waits for it"
    )
    loss: Loss | None = None
    duplication: Probability | None = parameter(
        None, "probability of a second copy, with a delay of its own"
    )
    bandwidth_bit_s: Annotated[float, Ge(LEAST_BANDWIDTH_BIT_S), Le(MOST)] | None = parameter(
        None, "messages leave one after the other"
    )
    message_bytes: Annotated[int, Ge(1), Le(65536)] | None = parameter(
        None, "length of a message with all headers, for the bandwidth; 128 if not given"
    )
    queue_messages: Annotated[int, Ge(1), Le(100_000)] | None = parameter(
        None, "that wait for the bandwidth; others are lost; 64 if not given"
    )
    partitions: Annotated[tuple[Partition, ...], Len(0, 1000)] | None = None
    distance: DistanceLoss | None = parameter(None, "between robots only")


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeEffects(Effects):
    """Effects of some edges, where they differ from what stands before."""

    edges: Annotated[tuple[str, ...], Len(1)] = field(
        metadata={"description": '"r1 -> r2", "* -> r2", "leader -> r1", "localisation -> *"'}
    )
