"""A panel over time, before any library draws it: lines, bands, bounds, and the span of its axis.

An axis isn't smaller than a floor, so that noise isn't drawn at full height; and a spike that is
rare doesn't squeeze everything else: the axis then ends before it, and the panel says so.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fleetloop.results.decimation import Points, drawable

FLOORS = {
    "m": 2e-3,
    "rad": 2e-3,
    "m/s": 1e-2,
    "rad/s": 1e-2,
    "N·m": 2e-2,
    "s": 1e-3,
    "µs": 20.0,
    "A": 0.2,
    "V": 0.5,
    "°C": 2.0,
    "%": 5.0,
}
"""Least span of an axis, by unit."""
_LEAST_PART = 1e-3
"""Least span, as part of the greatest magnitude on it."""
_RARE = 0.005
"""The part of all values on either side that may end beyond the axis if it is far out."""
_FAR = 2.0
"""Far out: so many times the span of the others beyond them."""
_PAD = 0.06


class LineStyle(NamedTuple):
    """Of a line; lengths in pixels or points."""

    colour: str
    dash: tuple[int, ...] = ()
    width: float = 1.4


class Line(NamedTuple):
    """One signal."""

    label: str
    groups: tuple[str, ...]
    """It is shown while all of these are on."""
    style: LineStyle
    points: Points


class Band(NamedTuple):
    """From the least to the greatest of several signals."""

    label: str
    colour: str
    t: np.ndarray
    low: np.ndarray
    high: np.ndarray


class Bound(NamedTuple):
    """What an expectation allows, over its window."""

    level: float
    from_s: float
    to_s: float
    state: str
    text: str


class Spot(NamedTuple):
    """The worst place of an expectation."""

    t_s: float
    value: float
    state: str
    text: str


class Span(NamedTuple):
    """Of an axis."""

    low: float
    high: float


@dataclass(slots=True)
class Panel:
    """What is drawn over time on one pair of axes."""

    title: str
    unit: str
    lines: list[Line] = field(default_factory=list)
    bands: list[Band] = field(default_factory=list)
    bounds: list[Bound] = field(default_factory=list)
    spots: list[Spot] = field(default_factory=list)
    logarithmic: bool = False
    group: str = ""
    """The whole panel is shown while this is on."""

    @property
    def floor(self) -> float:
        """Least span of its axis."""
        return floor(self.unit, self._values())

    @property
    def span(self) -> Span:
        """Of the axis for the whole run."""
        levels = [one.level for one in self.bounds]
        if self.logarithmic:
            return logarithmic_span(self._values(), self.unit)
        return span(self._values(), self.unit, levels)

    @property
    def beyond(self) -> str:
        """The peak that is beyond its axis, in words; nothing without one."""
        low, high = self.span
        peaks = [
            (abs(float(value)), float(value), float(line.points.t[at]), line.label)
            for line in self.lines
            if len(line.points.values)
            for at in [int(np.argmax(np.nan_to_num(np.abs(line.points.values), nan=-1.0)))]
            for value in [line.points.values[at]]
            if np.isfinite(value) and not low <= value <= high
        ]
        if not peaks:
            return ""
        _, value, t_s, label = max(peaks)
        return f"beyond the axis: {value:.4g} {self.unit} at {t_s:.4g} s ({label})"

    def _values(self) -> list[np.ndarray]:
        bands = (part for band in self.bands for part in (band.low, band.high))
        return [*(evenly(line.points) for line in self.lines), *bands]


@dataclass(slots=True)
class Section:
    """Panels under a heading."""

    key: str
    title: str
    note: str = ""
    panels: list[Panel] = field(default_factory=list)
    columns: int = 1
    keys: Sequence[tuple[str, LineStyle]] = ()
    """Groups of lines that aren't robots: what is told of them beside the panels."""


def floor(unit: str, series: Iterable[np.ndarray]) -> float:
    """Least span of an axis with these values."""
    peak = max((float(np.nanmax(np.abs(v))) for v in series if np.isfinite(v).any()), default=0.0)
    return max(FLOORS.get(unit, 0.0), _LEAST_PART * peak) or 1.0


def span(series: Sequence[np.ndarray], unit: str, levels: Sequence[float] = ()) -> Span:
    """The axis of a panel: all values but rare ones far out, levels near them, and its floor."""
    known = [values[np.isfinite(drawable(values))] for values in series]
    least = floor(unit, known)
    values = np.concatenate(known) if known else np.empty(0)
    if not len(values):
        return Span(-0.5 * least, 0.5 * least)
    low, high = float(values.min()), float(values.max())
    usual_low, usual_high = np.quantile(values, (_RARE, 1.0 - _RARE))
    usual = max(float(usual_high - usual_low), least)
    if low < usual_low - _FAR * usual:
        low = float(usual_low) - 0.5 * usual
    if high > usual_high + _FAR * usual:
        high = float(usual_high) + 0.5 * usual
    near = 10.0 * max(high - low, least)
    for level in levels:
        if low - near <= level <= high + near:
            low, high = min(low, level), max(high, level)
    missing = max(0.0, least - (high - low)) / 2.0
    pad = _PAD * max(high - low, least)
    return Span(low - missing - pad, high + missing + pad)


def logarithmic_span(series: Sequence[np.ndarray], unit: str) -> Span:
    """The axis of values above 0: whole decades, up to the floor of its unit at least."""
    values = np.concatenate([v[np.isfinite(drawable(v)) & (v > 0.0)] for v in series] or [[]])
    if not len(values):
        return Span(1e-3, 1.0)
    low = 10.0 ** np.floor(np.log10(max(float(np.quantile(values, _RARE)), 1e-9)))
    high = 10.0 ** np.ceil(np.log10(max(float(values.max()), FLOORS.get(unit, 0.0))))
    return Span(float(low), float(max(high, 10.0 * low)))


def evenly(points: Points) -> np.ndarray:
    """The values of a line at instants that are evenly apart, and its extremes."""
    t, values = points
    if len(t) < 3:
        return values
    at = np.searchsorted(t, np.linspace(t[0], t[-1], len(t)))
    known = values[np.isfinite(values)]
    ends = [known.min(), known.max()] if len(known) else []
    return np.concatenate([values[np.minimum(at, len(t) - 1)], ends])
