"""Studies whose rows are made by a function of their factors, written as any study's are."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from support.studies import plan_of

from fleetloop.sweep.cases import Cases
from fleetloop.sweep.dataset import Columns, Dataset, Row
from fleetloop.sweep.draws import Value
from fleetloop.sweep.report.derived import with_derived
from fleetloop.sweep.report.results import Results, results_of


@dataclass(frozen=True)
class Came:
    """What came of a case."""

    verdict: str = "held"
    margin: float | None = 0.1
    reason: str = ""
    values: Mapping[str, float | None] = field(default_factory=dict)
    engine: tuple[str, str] = ("kernel", "")


Outcome = Callable[[Mapping[str, Value]], Came]


def made_study(
    folder: Path, text: str, outcome: Outcome, numbers: Iterable[int] | None = None
) -> Path:
    """A folder with the rows of a study; all cases if none are named."""
    plan = plan_of(text)
    cases = Cases(plan)
    folder.mkdir(parents=True, exist_ok=True)
    plan.save(folder)
    dataset = Dataset(folder, cases.study.total, Columns(cases).schema)
    try:
        rows = [_row(cases, n, outcome) for n in numbers or range(cases.study.total)]
        dataset.add(Columns(cases).batch(rows))
    finally:
        dataset.close()
    return folder


def made_results(folder: Path, text: str, outcome: Outcome) -> Results:
    """The results of such a study."""
    return with_derived(results_of(made_study(folder, text, outcome)))


def _row(cases: Cases, number: int, outcome: Outcome) -> Row:
    case = cases.case(number)
    factors = cases.shown(case)
    came = outcome(factors)
    seed = factors.get("seed", cases.base.seed)
    return Row(
        number,
        factors,
        came.values,
        came.verdict,
        came.reason,
        came.margin,
        *came.engine,
        int(seed) if isinstance(seed, int) else None,
        0.01,
        cases.command(case),
    )
