"""When a study may end: its failure rate is known well enough, or its time is over.

The failure rate is that of the cases that held or failed. Its confidence interval is Wilson's; it
is looked at over the first cases by number, all of which are done: those that end quickly, as a
case that diverges at once, would come first otherwise, and count too much.
"""

from dataclasses import dataclass, field
from math import sqrt
from statistics import NormalDist

import numpy as np

from fleetloop.sweep.study import Stopping

HELD, FAILED = "held", "failed"


@dataclass(frozen=True, slots=True)
class Rate:
    """A failure rate and its confidence interval."""

    failed: int
    judged: int
    confidence: float

    @property
    def value(self) -> float | None:
        """None if no case was judged."""
        return self.failed / self.judged if self.judged else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's (1927); all of [0, 1] if no case was judged."""
        n = self.judged
        if n == 0:
            return 0.0, 1.0
        z = NormalDist().inv_cdf(0.5 + 0.5 * self.confidence)
        p = self.failed / n
        scale = 1.0 + z * z / n
        middle = (p + z * z / (2 * n)) / scale
        half = z * sqrt(p * (1.0 - p) / n + z * z / (4 * n * n)) / scale
        return max(0.0, middle - half), min(1.0, middle + half)

    @property
    def half_width(self) -> float:
        """Of the interval."""
        least, most = self.interval
        return 0.5 * (most - least)


@dataclass(slots=True)
class Tally:
    """The verdicts of a study's cases by number, as they come."""

    total: int
    _codes: np.ndarray = field(init=False)
    _first_open: int = 0
    _failed: int = 0
    _judged: int = 0

    def __post_init__(self) -> None:
        self._codes = np.zeros(self.total, dtype=np.int8)

    def add(self, number: int, verdict: str) -> None:
        """A case is done."""
        self._codes[number] = {HELD: 1, FAILED: 2}.get(verdict, 3)

    def rate(self, confidence: float) -> Rate:
        """Over the cases before the first that isn't done."""
        while self._first_open < self.total and (code := self._codes[self._first_open]):
            self._failed += int(code == 2)
            self._judged += int(code < 3)
            self._first_open += 1
        return Rate(self._failed, self._judged, confidence)

    def rate_of_all(self, confidence: float) -> Rate:
        """Over all cases that are done."""
        failed = int(np.count_nonzero(self._codes == 2))
        return Rate(failed, failed + int(np.count_nonzero(self._codes == 1)), confidence)


def decided(stopping: Stopping, tally: Tally, wall_s: float) -> str:
    """Why a study ends here, in words; "" if it goes on."""
    if stopping.budget_s is not None and wall_s >= stopping.budget_s:
        return f"budget_s = {stopping.budget_s:g} s is over"
    if stopping.failure_rate_within is None:
        return ""
    rate = tally.rate(stopping.confidence)
    if rate.judged < stopping.least_cases or rate.half_width > stopping.failure_rate_within:
        return ""
    least, most = rate.interval
    return (
        f"the failure rate is {least:.4f} to {most:.4f} ({100 * stopping.confidence:g} %,"
        f" {rate.failed} of {rate.judged} cases): within ±{stopping.failure_rate_within:g}"
    )
