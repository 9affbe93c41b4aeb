"""What is searched for: a parameter is a key of the scenario, or several, and a range of values.

    uniform      between two bounds
    log_uniform  between two bounds above 0, in the logarithm
    integers     whole numbers, both bounds included
    range        evenly spaced values
    values       these; they have no order

The words are those of a study's factors. Numbers of a continuum are rounded to `DIGITS` significant
digits before they are tried: gains are to be written down. A baseline is tried as it is given.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from configs.errors import KeyValueError
from configs.parameters import parameter
from fleetloop.sweep.draws import Value, level
from fleetloop.sweep.factors import FactorSection

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution

DIGITS = 4
_NOT = {"graph": "a graph is a factor", "normal": "give bounds: uniform, log_uniform"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSection(FactorSection):
    """One [[parameter]]: its key, or keys that all take the same value, and its range."""

    baseline: Value | None = parameter(None, "what the best value is compared with")

    def __post_init__(self) -> None:
        FactorSection.__post_init__(self)
        for kind, why in _NOT.items():
            if getattr(self, kind) is not None:
                raise KeyValueError(kind, f"isn't searched: {why}")
        if self.baseline is not None and not self._has(self.baseline):
            raise KeyValueError("baseline", f"must be one of its values: {self.extent}")

    @property
    def bounds(self) -> tuple[float, float] | None:
        """The ends of its continuum."""
        return self.uniform or self.log_uniform

    @property
    def logarithmic(self) -> bool:
        """Whether its values are spread evenly in the logarithm."""
        return self.log_uniform is not None or (self.range is not None and self.range.log)

    @property
    def extent(self) -> str:
        """Its values, in words."""
        if (bounds := self.bounds or self.integers) is not None:
            return f"{bounds[0]:g} to {bounds[1]:g}"
        return ", ".join(map(str, self._levels()))

    @property
    def middle(self) -> Value:
        """The baseline, or else a value from the middle."""
        return self.draw(()).at(0.5) if self.baseline is None else self.baseline

    @property
    def ends(self) -> tuple[Value, ...]:
        """The values that have to be valid by themselves: the bounds, or all there are."""
        if (bounds := self.bounds or self.integers) is not None:
            return tuple(bounds)
        return self._levels()

    def distribution(self) -> "BaseDistribution":
        """What Optuna draws from."""
        from optuna.distributions import (
            CategoricalDistribution,
            FloatDistribution,
            IntDistribution,
        )

        if (bounds := self.bounds) is not None:
            return FloatDistribution(*bounds, log=self.log_uniform is not None)
        if self.integers is not None:
            return IntDistribution(*self.integers)
        if self.range is not None:
            return IntDistribution(0, self.range.steps - 1)
        return CategoricalDistribution(self.values or ())

    def value(self, drawn: Value) -> Value:
        """The value that stands for what was drawn."""
        if (bounds := self.bounds) is not None:
            return min(max(float(f"{drawn:.{DIGITS}g}"), bounds[0]), bounds[1])
        return level(self.draw(()), int(drawn)) if self.range is not None else drawn

    def drawn(self, value: Value) -> Value:
        """What has to be drawn for a value."""
        return self._levels().index(value) if self.range is not None else value

    def _levels(self) -> tuple[Value, ...]:
        draw = self.draw(())
        return tuple(level(draw, n) for n in range(draw.count or 0))

    def _has(self, value: Value) -> bool:
        if (bounds := self.bounds or self.integers) is not None:
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if number and self.integers is not None and not isinstance(value, int):
                return False
            return number and bounds[0] <= float(value) <= bounds[1]
        return value in self._levels()
