"""What a study varies: a factor is a key of the scenario, or several, and the values that it takes.

    values       these, in turn
    range        steps values from least to most, both included; evenly, or evenly in the logarithm
    integers     all whole numbers from the first to the last, as of seeds
    graph        random graphs: the first robot reaches all others (`configs.graph.random_rooted`),
                 or a ring with chords (`configs.graph.random_ring`)
    uniform      between two bounds
    log_uniform  between two bounds above 0, evenly in the logarithm
    normal       mean and standard deviation; what is beyond least or most is drawn to the bound's
                 side of the distribution

The first four have levels; only they make a grid. `fleetloop.sweep.draws` takes samples to values.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated

from annotated_types import Ge, Le, Len

from configs.errors import KeyValueError
from configs.parameters import MOST_INTEGER, Finite, Parameters, Positive, Seed, parameter
from fleetloop.sweep.draws import (
    Column,
    Draw,
    GraphKind,
    Graphs,
    Integers,
    Levels,
    NormalDraw,
    Spaced,
    Uniform,
    Value,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Range(Parameters):
    """Evenly spaced values."""

    least: Finite = field(metadata={"description": "the first"})
    most: Finite = field(metadata={"description": "the last"})
    steps: Annotated[int, Ge(2), Le(100_000)] = field(metadata={"description": "their number"})
    log: bool = parameter(False, "evenly in the logarithm")

    def __post_init__(self) -> None:
        if self.most <= self.least:
            raise KeyValueError("most", f"the range is empty: must be above least = {self.least:g}")
        if self.log and self.least <= 0.0:
            raise KeyValueError("least", "must be greater than 0 with log = true")


@dataclass(frozen=True, slots=True, kw_only=True)
class Normal(Parameters):
    """A normal distribution, truncated where bounds are given."""

    mean: Finite = field(metadata={"description": "of the whole distribution"})
    sd: Positive = field(metadata={"description": "standard deviation of the whole distribution"})
    least: Finite | None = parameter(None, "nothing below")
    most: Finite | None = parameter(None, "nothing above")

    def __post_init__(self) -> None:
        if self.least is not None and self.most is not None and self.most <= self.least:
            raise KeyValueError("most", f"the range is empty: must be above least = {self.least:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomGraph(Parameters):
    """Random graphs, one for each seed."""

    kind: GraphKind = parameter(
        "rooted", "the first robot reaches all others; ring: with chords, each reaches all others"
    )

    seeds: tuple[Seed, Seed] = parameter((1, MOST_INTEGER), "the first and the last one")
    max_in_degree: Annotated[int, Ge(1), Le(256)] = parameter(2, "robots that one hears at most")

    def __post_init__(self) -> None:
        _refuse_empty("seeds", self.seeds, equal=True)


Pair = tuple[Finite, Finite]
PositivePair = tuple[Positive, Positive]
Whole = Annotated[int, Ge(-MOST_INTEGER), Le(MOST_INTEGER)]
WholePair = tuple[Whole, Whole]


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorSection(Parameters):
    """One [[factor]]: its key, or keys that all take the same value, and one kind of draw."""

    name: Column | None = parameter(None, "of its column; the last part of its key if not given")
    key: str | None = parameter(
        None, 'as in --set; "*" stands for every robot, as in robot.*.body.body_mass_kg'
    )
    keys: Annotated[tuple[str, ...], Len(1, 256)] | None = parameter(None, "instead of key")
    values: Annotated[tuple[Value, ...], Len(1, 100_000)] | None = parameter(None, "these, in turn")
    range: Range | None = parameter(None, "evenly spaced")
    integers: WholePair | None = parameter(None, "all whole numbers from the first to the last")
    graph: RandomGraph | None = parameter(None, "random graphs in the place of [graph]; no key")
    uniform: Pair | None = parameter(None, "between two bounds")
    log_uniform: PositivePair | None = parameter(None, "between two bounds, in the logarithm")
    normal: Normal | None = parameter(None, "normally distributed")

    def __post_init__(self) -> None:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            has = f", not {' and '.join(given)}" if given else ""
            raise KeyValueError(given[-1] if given else "values", f"one of {_ONE_OF}{has}")
        if self.graph is not None:
            if self.key is not None or self.keys is not None:
                raise KeyValueError("key", "graph replaces [graph]: leave out key")
        elif (self.key is None) == (self.keys is None):
            raise KeyValueError("key", "give key, or keys that all take the same value")
        for kind in ("uniform", "log_uniform", "integers"):
            if (pair := getattr(self, kind)) is not None:
                _refuse_empty(kind, pair, equal=kind == "integers")

    @property
    def every_key(self) -> tuple[str, ...]:
        """The keys that take its value."""
        if self.graph is not None:
            return (GRAPH,)
        return self.keys or (self.key or "",)

    @property
    def column(self) -> str:
        """Its name."""
        return self.name or self.every_key[0].rpartition(".")[2]

    @property
    def count(self) -> int | None:
        """Number of its levels; None if there is a continuum."""
        return self.draw(()).count

    def draw(self, robots: Sequence[str]) -> Draw:
        """What takes u to its value; `robots` of the base, in order."""
        if (some := self.range) is not None:
            return Spaced(some.least, some.most, some.steps, some.log)
        if self.integers is not None:
            return Integers(*self.integers)
        if (graph := self.graph) is not None:
            return Graphs(*graph.seeds, graph.max_in_degree, tuple(robots), graph.kind)
        if self.uniform is not None:
            return Uniform(*self.uniform)
        if self.log_uniform is not None:
            return Uniform(*self.log_uniform, log=True)
        if (of := self.normal) is not None:
            return NormalDraw(of.mean, of.sd, of.least, of.most)
        return Levels(self.values or ())


KINDS = tuple(key.name for key in fields(FactorSection) if key.name not in ("name", "key", "keys"))
_ONE_OF = ", ".join(KINDS)
GRAPH = "graph"
"""The section that random graphs replace."""


def _refuse_empty(key: str, pair: tuple[float, float], *, equal: bool) -> None:
    least, most = pair
    if most < least or (most == least and not equal):
        above = "at least" if equal else "above"
        raise KeyValueError(key, f"the range is empty: its end must be {above} {least:g}")
