"""Where the signals of two runs part, and how far they get from each other.

Rows are compared bit for bit, so 0.0 and -0.0 differ; with a tolerance two values are alike up to
that distance, ends included. A value that is not a number in one of both is infinitely far away.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from rich.table import Table

from configs.errors import ScenarioError
from configs.signals import Signal
from fleetloop.results.tables import table_box

SHOWN = 20
"""Signals of a table, unless all are asked for."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The distances up to which values are alike; none: bit for bit."""

    of_all: float | None = None
    of_signal: Mapping[str, float] = field(default_factory=dict)

    def of(self, signal: str) -> float | None:
        """That of a signal, in its unit."""
        return self.of_signal.get(signal, self.of_all)

    def __bool__(self) -> bool:
        """Whether there is any."""
        return self.of_all is not None or bool(self.of_signal)

    @classmethod
    def parse(cls, texts: Iterable[str]) -> "Tolerance":
        """From the texts of `--tolerance`: 1e-6 for all signals, or s=1e-6 for one.

        Raises:
            ScenarioError: one is no number from 0 on, or given twice.
        """
        of_all: float | None = None
        of_signal: dict[str, float] = {}
        for text in texts:
            name, equals, number = text.rpartition("=")
            try:
                value = float(number)
            except ValueError:
                value = -1.0
            if not (isfinite(value) and value >= 0.0) or (equals and not name):
                remedy = "must be a number from 0 on, or signal=number, for example s=1e-6"
                raise ScenarioError(f"--tolerance {text}: {remedy}")
            if name in of_signal or (not name and of_all is not None):
                raise ScenarioError(
                    f"--tolerance {text}: {name or 'that of all signals'} came twice"
                )
            if name:
                of_signal[name] = value
            else:
                of_all = value
        return cls(of_all, of_signal)


EXACT = Tolerance()


class Pair(NamedTuple):
    """Rows of one robot's source in both runs, of the same ticks."""

    robot: str
    source: str  # plant or controller
    a: np.ndarray
    b: np.ndarray


class Place(NamedTuple):
    """One value of a signal in both runs."""

    tick: int
    t_s: float
    robot: str
    a: float
    b: float


class Divergence(NamedTuple):
    """A signal whose values differ, over all robots."""

    source: str
    signal: Signal
    first: Place
    largest: Place
    size: float
    """|a − b| where it is largest; inf: one of both is not a number."""
    scale: float
    """Greatest finite magnitude of the signal in A."""
    values: int
    """How many differ."""
    order: tuple[int, int, int]
    """Of the first: tick, number of its pair, column."""

    @property
    def relative(self) -> float:
        """The size as part of the scale."""
        return self.size / self.scale if self.scale > 0.0 else inf

    def as_dict(self) -> dict[str, object]:
        """For JSON; what is not a finite number is None."""
        return {
            "signal": self.signal.name,
            "source": self.source,
            "unit": self.signal.unit,
            "first": _finite(self.first._asdict()),
            "largest": _finite(self.largest._asdict()),
            **_finite({"size": self.size, "relative": self.relative}),
            "values": self.values,
        }


def _finite(values: Mapping[str, object]) -> dict[str, object]:
    return {
        name: None if isinstance(value, float) and not isfinite(value) else value
        for name, value in values.items()
    }


def divergences(
    pairs: Sequence[Pair], tables: Mapping[str, Sequence[Signal]], tolerance: Tolerance = EXACT
) -> list[Divergence]:
    """The signals that differ, in the order of their first differences.

    Args:
        pairs: of the same length and ticks each; signals that only one has are left out.
        tables: units, by source.
        tolerance: up to which values are alike.
    """
    found: dict[tuple[str, str], Divergence] = {}
    signals = {(source, one.name): one for source, table in tables.items() for one in table}
    for number, pair in enumerate(pairs):
        for column, name in enumerate(pair.a.dtype.names or ()):
            if name == "tick" or name not in (pair.b.dtype.names or ()):
                continue
            key = pair.source, name
            signal = signals.get(key, Signal(name, "", ""))
            one = _divergence(pair, signal, tolerance.of(name), (number, column))
            if one is not None:
                found[key] = _joined(found[key], one) if key in found else one
    return sorted(found.values(), key=lambda one: one.order)


def by_size(found: Iterable[Divergence]) -> list[Divergence]:
    """The largest first, each measured by its signal's greatest magnitude."""
    return sorted(found, key=lambda one: (-one.relative, one.order))


def _divergence(
    pair: Pair, signal: Signal, tolerance: float | None, place: tuple[int, int]
) -> Divergence | None:
    a = np.ascontiguousarray(pair.a[signal.name])
    b = np.ascontiguousarray(pair.b[signal.name])
    differ = a.view("<u8") != b.view("<u8")
    if not differ.any():
        return None
    with np.errstate(all="ignore"):
        size = np.abs(a - b)
    size[np.isnan(size)] = inf
    if tolerance is not None:
        differ &= size > tolerance
        if not differ.any():
            return None
    size[~differ] = -1.0
    finite = np.abs(a[np.isfinite(a)])
    first, largest = int(differ.argmax()), int(size.argmax())

    def at(row: int) -> Place:
        tick, t_s = int(pair.a["tick"][row]), float(pair.a["t_s"][row])
        return Place(tick, t_s, pair.robot, float(a[row]), float(b[row]))

    return Divergence(
        source=pair.source,
        signal=signal,
        first=at(first),
        largest=at(largest),
        size=float(size[largest]),
        scale=float(finite.max(initial=0.0)),
        values=int(differ.sum()),
        order=(int(pair.a["tick"][first]), *place),
    )


def _joined(one: Divergence, other: Divergence) -> Divergence:
    """That of two robots."""
    earlier = min(one, other, key=lambda it: it.order)
    larger = max(one, other, key=lambda it: it.size)
    return earlier._replace(
        largest=larger.largest,
        size=larger.size,
        scale=max(one.scale, other.scale),
        values=one.values + other.values,
    )


def divergence_table(
    found: Sequence[Divergence],
    *,
    labels: tuple[str, str],
    size_first: bool = False,
    most: int | None = SHOWN,
    of_one: bool = False,
) -> Table:
    """The first `most` of the ranking as a table.

    Args:
        found: in the order of first differences.
        labels: names of A and B.
        size_first: rank by size.
        most: signals; None: all.
        of_one: all are of one robot's controller, which isn't said again.
    """
    title = "signals by the size of their difference" if size_first else "signals as they part"
    table = Table(title=title, box=table_box(), padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("signal", no_wrap=True)
    table.add_column("parts at", justify="right", no_wrap=True)
    if not of_one:
        table.add_column("robot", no_wrap=True)
    for header in ("largest difference", "of its peak", "at", *labels):
        table.add_column(header, justify="right", no_wrap=True)
    if not of_one:
        table.add_column("robot", no_wrap=True)
    for one in (by_size(found) if size_first else found)[:most]:
        first, largest = one.first, one.largest
        table.add_row(
            one.signal.name if of_one else f"{one.source} {one.signal.name}",
            f"{first.t_s:.3f} s",
            *(() if of_one else (first.robot,)),
            f"{one.size:.3g} {one.signal.unit}" if isfinite(one.size) else "not a number",
            f"{one.relative:.2g}" if isfinite(one.relative) else "-",
            f"{largest.t_s:.3f} s",
            f"{largest.a:.6g}",
            f"{largest.b:.6g}",
            *(() if of_one else (largest.robot,)),
        )
    return table
