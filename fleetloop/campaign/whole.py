"""A cell whose fault is about processes: a whole run over processes."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

from bridge.network.messages import Progress
from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop
from configs.deployment import Deployment
from configs.faults.base import Fault
from configs.loading import to_toml
from fleetloop.campaign.matrix import Cell, Conditions, command, under, windows
from fleetloop.campaign.verdicts import Outcome, Result, Verdict, verdict_of
from fleetloop.jobs.job import Tell, Told
from fleetloop.launch.accounts import stats_of
from fleetloop.launch.process_run import ProcessRun
from fleetloop.record.reader import Record
from fleetloop.record.scan import RecordError
from fleetloop.results import run_folder


@dataclass(frozen=True, slots=True)
class WholeRun:
    """A job: one cell over processes; tells its `Result`. Its folder goes when it is judged."""

    told: Told
    source: str
    given: tuple[str, ...]
    cell: Cell
    fault: Fault
    kept_from_s: tuple[float, ...]
    conditions: Conditions
    folder: Path

    def work(self, tell: Tell, stop: Stop) -> bool:
        """Run and judge."""
        result = self._result(tell, stop)
        if result is not None:
            tell(result)
        return True

    def _result(self, tell: Tell, stop: Stop) -> Result | None:
        """The result; None if it was told to stop."""
        scenario = self.told.scenario()
        scenario = scenario.model_copy(
            update={"seed": self.cell.seed, "bus": replace(scenario.bus, record=())}
        )
        asked = windows(scenario, self.kept_from_s, self.fault, self.conditions)
        made = under(scenario, self.fault, self.cell.seed, asked)
        again = command(self.source, self.given, made, in_process=False)
        self.folder.mkdir(parents=True, exist_ok=True)
        record = self.folder / run_folder.RECORD
        (self.folder / run_folder.SCENARIO).write_text(to_toml(made), "utf-8")

        def on_progress(state: Progress) -> None:
            tell(state)

        began_s = SYSTEM_CLOCK.monotonic_s()
        run = ProcessRun(
            made,
            run=f"campaign-{SYSTEM_CLOCK.monotonic_ns() % 1_000_000_000:09d}",
            record=record,
            speed=0.0,
            profile=False,
            on_progress=on_progress,
            on_event=lambda _: None,
            on_notice=lambda *_: None,
            deployment=Deployment(),
        )
        period_s = made.clock.control_period_s
        try:
            stats = stats_of(run.run(stop), realtime=False, period_s=period_s)
            if stop.requested:
                return None
            if stats.ended != "completed":
                return Result(
                    self.cell, Verdict.ERROR, f"{stats.ended}: {stats.reason}", command=again
                )
            outcome = Outcome(Record.open(record), stats.stopped_robots, stats.events)
            found = verdict_of(self.cell, made, asked.strict, outcome)
        except RecordError as error:
            found = Result(self.cell, Verdict.ERROR, str(error))
        finally:
            run.close()
            shutil.rmtree(self.folder, ignore_errors=True)
        wall_s = round(SYSTEM_CLOCK.monotonic_s() - began_s, 3)
        return replace(found, command=again, wall_s=wall_s)
