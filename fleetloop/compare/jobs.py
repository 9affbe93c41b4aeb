"""The jobs of a comparison, and what each brings."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from bridge.network.messages import Progress
from bridge.process.lifecycle import Stop
from configs.loading import to_toml
from fleetloop.compare.measures import Course, Measures, courses, measures
from fleetloop.compare.step_cost import Sample, StepCost, samples, step_costs
from fleetloop.jobs.job import Tell, Told
from fleetloop.launch.conduct import Listener, run_in_process
from fleetloop.record.reader import Record
from fleetloop.results import run_folder
from fleetloop.results.summary import Summary, summarise, to_json


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run came to."""

    summary: Summary
    measures: Measures | None = None
    """None: no robot had a tick."""
    courses: Mapping[str, Course] | None = None
    samples: tuple[Sample, ...] = ()


@dataclass(frozen=True, slots=True)
class Trial:
    """One law, one seed: a run in its process, with its folder."""

    told: Told
    folder: Path
    keep_record: bool

    def work(self, tell: Tell, stop: Stop) -> Outcome:
        """Run, measure, write scenario.toml and summary.json.

        Raises:
            ScenarioError, InfrastructureError: the run could not start, or ended early.
        """
        scenario = self.told.scenario()
        self.folder.mkdir(parents=True)
        run_folder.write(self.folder / run_folder.SCENARIO, to_toml(scenario))

        def on_progress(progress: Progress) -> None:
            tell(progress)

        if not self.keep_record:
            scenario = scenario.model_copy(update={"bus": replace(scenario.bus, record=())})
        stats = run_in_process(
            scenario, self.folder, Listener(on_progress, lambda _: None, lambda *_: None), stop
        )
        path = self.folder / run_folder.RECORD
        record = Record.open(path)
        summary = summarise(record, scenario, stats)
        run_folder.write(self.folder / run_folder.SUMMARY, to_json(summary))
        if not self.keep_record:
            path.unlink()
        if not summary["robots"]:
            return Outcome(summary)
        return Outcome(
            summary,
            measures(record, scenario, summary),
            courses(record, scenario),
            tuple(samples(record)),
        )


@dataclass(frozen=True, slots=True)
class CostOfSteps:
    """The laws in turn, in one process."""

    told: Mapping[str, Told]
    samples: tuple[Sample, ...]

    def work(self, tell: Tell, stop: Stop) -> dict[str, StepCost]:  # noqa: ARG002 - it is short
        """Cost by label."""
        scenarios = {label: told.scenario() for label, told in self.told.items()}
        return step_costs(scenarios, self.samples)
