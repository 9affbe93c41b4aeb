"""What a comparison came to: a row per law, its runs by seed, and the worst of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan
from typing import Any

from configs.choices import table_of
from configs.scenario import Scenario
from configs.sections import LAW
from fleetloop.compare.jobs import Outcome
from fleetloop.compare.measures import Measures
from fleetloop.compare.step_cost import StepCost
from fleetloop.jobs.pool import Failed


@dataclass(frozen=True, slots=True)
class Row:
    """A law, and what became of it with each seed."""

    label: str
    scenario: Scenario
    runs: Mapping[int, Outcome | Failed]
    cost: StepCost | None = None
    worst: Measures | None = field(init=False)
    """Of every number the worst over the seeds; None: no run has any."""

    def __post_init__(self) -> None:
        found = [run.measures for run in self.outcomes if run.measures is not None]
        object.__setattr__(self, "worst", _worst(found) if found else None)

    @property
    def law(self) -> str:
        """The name of the fleet's law."""
        return self.scenario.control.name

    @property
    def gains(self) -> Mapping[str, Any]:
        """The gains of the fleet's law, defaults written out."""
        table = table_of(self.scenario.control, LAW.key)
        return {key: value for key, value in table.items() if key != LAW.key}

    @property
    def outcomes(self) -> list[Outcome]:
        """The runs that came to an end."""
        return [run for run in self.runs.values() if isinstance(run, Outcome)]

    @property
    def sound(self) -> bool:
        """Whether all runs came to their end and no robot stopped itself."""
        return not self.troubles

    @property
    def troubles(self) -> list[str]:
        """Why runs ended early, and which robots stopped themselves."""
        lines = []
        for seed, run in self.runs.items():
            where = f"seed {seed}: " if len(self.runs) > 1 else ""
            if isinstance(run, Failed):
                lines.append(f"{where}{run}")
                continue
            stopped = run.summary["stopped_robots"]
            lines += [f"{where}{robot} stopped: {why}" for robot, why in stopped.items()]
            if run.summary["verdict"] == "aborted":
                lines.append(f"{where}{run.summary['reason']}")
        return lines

    @property
    def expectations(self) -> list[bool | None]:
        """Whether each of the scenario's expectations held, in all runs; None: not reached."""
        return [item["held"] for run in self.outcomes for item in run.summary["expectations"]]


def described(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Rows for compare.json."""
    return [
        {
            "label": row.label,
            "law": row.law,
            "gains": dict(row.gains),
            "worst": row.worst,
            "step": None if row.cost is None else row.cost._asdict(),
            "troubles": row.troubles,
            "runs": [
                {
                    "seed": seed,
                    "verdict": run.summary["verdict"],
                    "ticks": run.summary["ticks"],
                    "expectations": run.summary["expectations"],
                    "measures": run.measures,
                }
                if isinstance(run, Outcome)
                else {"seed": seed, "verdict": "aborted", "reason": str(run)}
                for seed, run in row.runs.items()
            ],
        }
        for row in rows
    ]


def _worst(values: Sequence[Any]) -> Any:
    """The greatest of numbers, table by table; where one has none, or it is no number, that."""
    first = values[0]
    if isinstance(first, dict):
        return {key: _worst([value[key] for value in values]) for key in first}
    if None in values:
        return None
    return next((value for value in values if isnan(value)), max(values))
