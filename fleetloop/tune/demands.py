"""What is asked of the parameters: an objective, and constraints, of quantities over all cases.

A quantity has a value in each case; one number of all of them is asked for:

    "mean", "median"    of the cases
    "worst"             the greatest if it is to be small, the least if it is to be great
    0.9                 what 90 % of the cases reach; 1.0 is the worst

A case without a value, as one whose error never settles, counts as worse than any: of a mean or a
worst case there is no number then, and the demand isn't met. With `missing` it counts as that.

`failure_rate` is the share of cases that failed, are invalid, or ended with an error. A trial is
feasible if it meets every constraint and its objective has a number. How far it misses them is

    Σ max(0, value − at_most) / |at_most|       of the constraints with a number; at_least alike
      + the share of cases without a value      of the others, and of the objective

with 1 for |at_most| of a bound that is 0: by that infeasible trials are ranked.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Gt, Le, Len

from configs.errors import KeyValueError
from configs.parameters import Finite, Parameters, parameter

FAILURE_RATE, MARGIN = "failure_rate", "margin"
Over = Literal["mean", "median", "worst"] | Annotated[float, Gt(0), Le(1)]
Quantity = Annotated[str, Len(1, 100)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Objective(Parameters):
    """What is to be as small, or as great, as can be."""

    quantity: Quantity = field(metadata={"description": "as in [keep] of a study, or failure_rate"})
    over: Over = parameter("mean", "which number of all cases")
    direction: Literal["minimise", "maximise"] = parameter("minimise", "small, or great")
    missing: Finite | None = parameter(None, "what a case without a value counts as")

    @property
    def sign(self) -> float:
        """By which a greater value is worse."""
        return 1.0 if self.direction == "minimise" else -1.0

    @property
    def label(self) -> str:
        """In words."""
        return _label(self.quantity, self.over)


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraint(Parameters):
    """What must be so."""

    quantity: Quantity = field(metadata={"description": "as in [keep] of a study, or failure_rate"})
    over: Over = parameter("worst", "which number of all cases")
    at_most: Finite | None = parameter(None, "the greatest that it may be")
    at_least: Finite | None = parameter(None, "the least that it may be")
    missing: Finite | None = parameter(None, "what a case without a value counts as")

    def __post_init__(self) -> None:
        if (self.at_most is None) == (self.at_least is None):
            raise KeyValueError("at_most", "give at_most, or at_least")

    @property
    def sign(self) -> float:
        """By which a greater value is worse."""
        return 1.0 if self.at_most is not None else -1.0

    @property
    def bound(self) -> float:
        """What it is compared with."""
        return self.at_most if self.at_most is not None else (self.at_least or 0.0)

    @property
    def label(self) -> str:
        """In words."""
        sign = "≤" if self.sign > 0 else "≥"
        return f"{_label(self.quantity, self.over)} {sign} {self.bound:g}"

    def missed_by(self, value: float) -> float:
        """How far, relative to the bound; 0 if it is met."""
        over = self.sign * (value - self.bound)
        return max(0.0, over / (abs(self.bound) or 1.0))


class Number(NamedTuple):
    """The number of a demand over all cases."""

    value: float | None
    missing: float
    """Share of the cases without a value."""


def number_of(demand: Objective | Constraint, values: Sequence[float | None]) -> Number:
    """The number that a demand is about.

    Args:
        demand: an objective or a constraint.
        values: of its quantity, a case each.
    """
    known = [demand.missing if v is None or not isfinite(v) else v for v in values]
    lacking = sum(v is None for v in known) / max(len(known), 1)
    worse = np.array([inf if v is None else demand.sign * v for v in known])
    if not len(worse):
        return Number(None, 1.0)
    found = _over(demand.over if demand.quantity != FAILURE_RATE else "mean", worse)
    return Number(demand.sign * found if isfinite(found) else None, lacking)


def _over(over: Over, worse: np.ndarray) -> float:
    """That number of values of which the greater one is worse."""
    if over == "mean":
        return float(np.mean(worse))
    if over == "median":
        return float(np.quantile(worse, 0.5, method="inverted_cdf"))
    share = 1.0 if over == "worst" else float(over)
    return float(np.quantile(worse, share, method="inverted_cdf"))


def _label(quantity: str, over: Over) -> str:
    if quantity == FAILURE_RATE:
        return "failure rate"
    if isinstance(over, float):
        return f"{quantity} of {100 * over:g} %"
    return f"{over} {quantity}"
