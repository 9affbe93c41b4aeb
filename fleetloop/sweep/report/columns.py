"""Columns of a study's dataset as they are drawn and told: numbers or levels, units, labels.

A factor's unit is that at the end of its name, or of the key that it sets: `body_mass_kg` is
"body_mass [kg]". A factor of texts has levels; its values here are their places.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Series = NDArray[np.float64]
UNITS = {
    "N_m_s": "N·m·s",
    "N_m_A": "N·m/A",
    "kg_m2": "kg·m²",
    "bit_s": "bit/s",
    "rad_s": "rad/s",
    "rad_m": "rad/m",
    "m_s2": "m/s²",
    "m_s": "m/s",
    "N_m": "N·m",
    "ohm": "Ω",
    "rad": "rad",
    "kg": "kg",
    "Hz": "Hz",
    "s": "s",
    "m": "m",
    "N": "N",
    "V": "V",
    "A": "A",
}
"""By how a name ends, the longest first."""
MOST_LEVELS = 24
"""Different values of a column that each stand for themselves on an axis."""
OUTLIER = 100.0
"""Magnitude of an outlier in typical ones."""
_LONGEST = 28
"""Characters of a label of a level."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column: a value per case, NaN where there is none."""

    name: str
    values: Series
    unit: str = ""
    levels: tuple[str, ...] = ()
    """Of texts; values are places in it."""
    log: bool = False
    """Whether it is spread evenly in the logarithm."""
    exact: bool = False
    """Whether all its different values are levels of a grid."""
    symbol: str = ""
    """How it is told, instead of its name without its unit."""

    @property
    def label(self) -> str:
        """Name and unit."""
        told = self.symbol or stem(self.name)
        return f"{told} [{self.unit}]" if self.unit else told

    @property
    def distinct(self) -> Series:
        """Its different values in ascending order."""
        found: Series = np.unique(self.values[np.isfinite(self.values)])
        return found

    @property
    def varies(self) -> bool:
        """Whether it has more than one value."""
        return len(self.distinct) > 1

    @property
    def is_axis(self) -> bool:
        """Whether it can be an axis: numbers, or not too many texts."""
        return self.varies and len(self.levels) <= MOST_LEVELS

    def shown(self, value: float) -> str:
        """A value in words."""
        if np.isnan(value):
            return "-"
        return shortened(self.levels[int(value)]) if self.levels else f"{value:.4g}"

    def take(self, rows: NDArray[np.bool_]) -> "Column":
        """Of some cases."""
        return Column(
            self.name,
            self.values[rows],
            self.unit,
            self.levels,
            self.log,
            self.exact,
            self.symbol,
        )


def stem(name: str) -> str:
    """A name without its unit."""
    for end in UNITS:
        if name.endswith(f"_{end}"):
            return name.removesuffix(f"_{end}")
    return name


def unit_of(name: str, keys: Sequence[str] = ()) -> str:
    """The unit at the end of a name, or else of a key."""
    for text in (name, *keys[:1]):
        last = text.rpartition(".")[2]
        for end, unit in UNITS.items():
            if last.endswith(f"_{end}"):
                return unit
    return ""


def shortened(text: str) -> str:
    """A text for an axis."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def of_texts(name: str, texts: Sequence[str | None]) -> Column:
    """A column of texts; its levels in the order in which they come."""
    levels = {text: n for n, text in enumerate(dict.fromkeys(t for t in texts if t is not None))}
    places = np.array([np.nan if t is None else levels[t] for t in texts], dtype=np.float64)
    return Column(name, places, levels=tuple(levels), exact=True)


def wrapped(text: str, most: int) -> list[str]:
    """A text in lines of about so many characters, broken behind blanks and underscores."""
    lines = [""]
    for part in re.findall(r"[^ _]+[ _]*|[ _]+", text):
        if lines[-1] and len(lines[-1]) + len(part.rstrip()) > most:
            lines.append("")
        lines[-1] += part
    return [line.rstrip(" ") for line in lines]


def linear_width(values: Series) -> float:
    """Of a scale that is linear near 0 and logarithmic beyond, where outliers need one; else 0."""
    typical = float(np.median(np.abs(values))) if len(values) else 0.0
    return typical if np.abs(values).max(initial=0.0) > OUTLIER * typical else 0.0


def nice_marks(low: float, high: float, *, log: bool, most: int = 6) -> list[float]:
    """Round values from low to high, both included: some of them, or else these two."""
    if log:
        marks = [m * 10.0**e for e in range(-12, 13) for m in (1, 2, 5)]
    else:
        step = 10.0 ** np.floor(np.log10(high - low))
        steps = [part * step for part in (0.1, 0.2, 0.5, 1.0, 2.0)]
        step = next(one for one in steps if (high - low) / one < most)
        marks = [n * step for n in range(int(np.floor(low / step)), int(np.ceil(high / step)) + 1)]
    slack = 1e-9 * (high - low)
    inside = [one for one in marks if low - slack <= one <= high + slack]
    if log and len(inside) > most:
        inside = [one for one in inside if f"{one:e}".startswith("1")]
    return inside if len(inside) > 1 else [low, high]
