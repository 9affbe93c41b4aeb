"""Draws: what takes a sample of a design to the value of a factor.

A draw takes u in [0, 1) to a value by the quantile function Q(u) of its distribution; one with
levels by equal shares, Q(u) = level[⌊u·count⌋]. Values of a continuum are rounded to `DIGITS`
significant digits, so that a command that repeats them is short and exact.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Annotated, Any, Literal, Protocol

from configs import patterns
from configs.edges import Edge, edge_text
from configs.graph import random_ring, random_rooted
from configs.parameters import Pattern

DIGITS = 9
_U_LEAST = 2.0**-53
"""Of a normal distribution u = 0 is no number."""

GraphKind = Literal["rooted", "ring"]
Value = bool | int | float | str
Column = Annotated[str, Pattern(patterns.COLUMN, max_length=64)]
"""The name of a column of a dataset."""


class Draw(Protocol):
    """Takes u in [0, 1) to a value."""

    @property
    def count(self) -> int | None:
        """Number of its levels; None if there is a continuum."""

    def at(self, u: float) -> Value:
        """Q(u)."""

    def shown(self, value: Value) -> Value:
        """As the dataset has it."""

    def overrides(self, value: Value, table: dict[str, Any]) -> object:
        """What the keys are set to; `table` is what is there, if it is a table."""


def level(draw: Draw, n: int) -> Value:
    """One of the levels of a draw that has some: Q((n + ½)/count)."""
    return draw.at((n + 0.5) / (draw.count or 1))


@dataclass(frozen=True, slots=True)
class _Plain:
    """A value that is what its keys are set to."""

    def shown(self, value: Value) -> Value:
        """As it is."""
        return value

    def overrides(self, value: Value, table: dict[str, Any]) -> object:  # noqa: ARG002
        """As it is."""
        return value


@dataclass(frozen=True, slots=True)
class Levels(_Plain):
    """These values."""

    values: tuple[Value, ...]

    @property
    def count(self) -> int | None:
        """Their number."""
        return len(self.values)

    def at(self, u: float) -> Value:
        """By equal shares."""
        return self.values[_share(u, len(self.values))]


@dataclass(frozen=True, slots=True)
class Spaced(_Plain):
    """Evenly spaced values, or evenly in the logarithm."""

    least: float
    most: float
    steps: int
    log: bool = False

    @property
    def count(self) -> int | None:
        """Their number."""
        return self.steps

    def at(self, u: float) -> Value:
        """By equal shares."""
        n = _share(u, self.steps)
        return _between(self.least, self.most, n / (self.steps - 1), log=self.log)


@dataclass(frozen=True, slots=True)
class Integers(_Plain):
    """Whole numbers, the last included."""

    first: int
    last: int

    @property
    def count(self) -> int | None:
        """Their number."""
        return self.last - self.first + 1

    def at(self, u: float) -> Value:
        """By equal shares."""
        return self.first + _share(u, self.last - self.first + 1)


@dataclass(frozen=True, slots=True)
class Graphs:
    """Random graphs by their seeds, the last included."""

    first: int
    last: int
    max_in_degree: int
    robots: tuple[str, ...]
    kind: GraphKind = "rooted"

    @property
    def count(self) -> int | None:
        """Number of seeds."""
        return self.last - self.first + 1

    def at(self, u: float) -> Value:
        """By equal shares."""
        return self.first + _share(u, self.last - self.first + 1)

    def shown(self, value: Value) -> Value:
        """Its edges: "r1>r2 r2>r3"."""
        edges = self._edges(value)
        return " ".join(f"{speaker}>{hearer}" for speaker, hearer in edges)

    def overrides(self, value: Value, table: dict[str, Any]) -> object:
        """The section with this graph; its leader links and normalised weights stay."""
        edges = self._edges(value)
        kept: dict[str, Any] = {key: table[key] for key in ("leader", "weights") if key in table}
        if isinstance(kept.get("weights"), dict):  # of edges that aren't there any more
            del kept["weights"]
        return {"edges": [edge_text(edge) for edge in edges], **kept}

    def _edges(self, value: Value) -> tuple[Edge, ...]:
        return _graph(self, int(value))


@lru_cache(maxsize=64)
def _graph(graphs: Graphs, seed: int) -> tuple[Edge, ...]:
    """The edges of one graph: a case needs them for its scenario, its row and its command."""
    make = random_ring if graphs.kind == "ring" else random_rooted
    return tuple(make(graphs.robots, max_in_degree=graphs.max_in_degree, seed=seed))


@dataclass(frozen=True, slots=True)
class Uniform(_Plain):
    """Between two bounds, evenly, or evenly in the logarithm."""

    least: float
    most: float
    log: bool = False

    @property
    def count(self) -> int | None:
        """A continuum."""
        return None

    def at(self, u: float) -> Value:
        """The share u of the way."""
        return _between(self.least, self.most, u, log=self.log)


@dataclass(frozen=True, slots=True)
class NormalDraw(_Plain):
    """Normally distributed: Q(u) = Φ⁻¹(Φ(least) + u (Φ(most) − Φ(least))), truncated by bounds."""

    mean: float
    sd: float
    least: float | None = None
    most: float | None = None

    @property
    def count(self) -> int | None:
        """A continuum."""
        return None

    def at(self, u: float) -> Value:
        """Its quantile."""
        whole = NormalDist(self.mean, self.sd)
        below = 0.0 if self.least is None else whole.cdf(self.least)
        above = 1.0 if self.most is None else whole.cdf(self.most)
        p = min(max(below + u * (above - below), _U_LEAST), 1.0 - _U_LEAST)
        return _within(_rounded(whole.inv_cdf(p)), self.least, self.most)


def _share(u: float, count: int) -> int:
    return min(int(u * count), count - 1)


def _between(least: float, most: float, u: float, *, log: bool) -> float:
    if log:
        value = math.exp(math.log(least) + u * (math.log(most) - math.log(least)))
    else:
        value = least + u * (most - least)
    return _within(_rounded(value), least, most)


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _within(value: float, least: float | None, most: float | None) -> float:
    if least is not None and value < least:
        return least
    return most if most is not None and value > most else value
