"""What a trial came to: the numbers of its demands, how its cases ended."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fleetloop.sweep.draws import Value
from fleetloop.tune.demands import FAILURE_RATE, Constraint, Objective, number_of
from fleetloop.tune.tuning import Tuning

if TYPE_CHECKING:
    import pyarrow as pa

OF_THE_OBJECTIVE = "objective has a number"
_BAD = ("failed", "invalid", "error")


@dataclass(frozen=True, slots=True)
class Score:
    """Of the cases of one trial."""

    objective: float | None
    constraints: Mapping[str, float | None]
    """The numbers of the constraints, by their labels."""
    missed: Mapping[str, float]
    """How far each is missed, and how much of the objective is missing; 0: met."""
    verdicts: Mapping[str, int]
    engines: Mapping[str, int]
    reason: str
    """Of the first case that didn't hold."""

    @property
    def feasible(self) -> bool:
        """Whether all demands are met."""
        return self.misses == 0.0

    @property
    def misses(self) -> float:
        """How far all of them together are missed."""
        return sum(self.missed.values())

    @property
    def cases(self) -> int:
        """How many there were."""
        return sum(self.verdicts.values())

    @property
    def bad(self) -> int:
        """How many of them count as failures."""
        return sum(self.verdicts.get(verdict, 0) for verdict in _BAD)

    def told(self) -> dict[str, Any]:
        """As a table, for files."""
        return {
            "objective": self.objective,
            "constraints": dict(self.constraints),
            "missed": dict(self.missed),
            "verdicts": dict(self.verdicts),
            "engines": dict(self.engines),
            "reason": self.reason,
        }


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial that is done."""

    number: int
    """From 0 on; if there is a baseline, that is 0."""
    values: Mapping[str, Value]
    score: Score


def score(tuning: Tuning, rows: "pa.Table") -> Score:
    """What the cases of a trial came to.

    Args:
        tuning: what is asked.
        rows: of all cases.
    """
    objective = number_of(tuning.objective, column(rows, tuning.objective))
    constraints: dict[str, float | None] = {}
    missed: dict[str, float] = {}
    for one in tuning.demands:
        found = number_of(one, column(rows, one))
        constraints[one.label] = found.value
        missed[one.label] = found.missing if found.value is None else one.missed_by(found.value)
    missed[OF_THE_OBJECTIVE] = objective.missing if objective.value is None else 0.0
    verdicts = rows.column("verdict").to_pylist()
    reasons = zip(verdicts, rows.column("reason").to_pylist(), strict=True)
    return Score(
        objective.value,
        constraints,
        missed,
        Counter(verdicts),
        Counter(filter(None, rows.column("engine").to_pylist())),
        next((reason for verdict, reason in reasons if verdict in _BAD), ""),
    )


def column(rows: "pa.Table", demand: Objective | Constraint) -> list[float | None]:
    """The values of a demand's quantity, a case each."""
    if demand.quantity == FAILURE_RATE:
        return [float(verdict in _BAD) for verdict in rows.column("verdict").to_pylist()]
    found: list[float | None] = rows.column(demand.quantity).to_pylist()
    return found


def best(tuning: Tuning, trials: Sequence[Trial]) -> Trial | None:
    """The best feasible trial, the first of equal ones; else the one that misses least."""
    sign = tuning.objective.sign

    def rank(trial: Trial) -> tuple[float, float, int]:
        value = trial.score.objective
        return trial.score.misses, float("inf") if value is None else sign * value, trial.number

    return min(trials, key=rank, default=None)
