"""`fleetloop run`: one scenario from file to results."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from bridge.network.messages import Progress
from bridge.process.clock import SYSTEM_CLOCK, local_date
from bridge.process.lifecycle import Stop, keep_to_itself
from configs.connections import NetworkLink
from configs.deployment import Deployment, load_deployment
from configs.errors import ExitStatus, FleetloopError, InfrastructureError, ScenarioError
from configs.events import KINDS, Event, in_order, told
from configs.faults.plan import process_fault_problem
from configs.loading import load, to_toml
from configs.overrides import Overrides
from configs.resolve import agent_brief, leader_brief, plant_brief, schedule, signals_of
from configs.roles import short_name
from configs.scenario import Scenario
from fleetloop.check.examine import examine
from fleetloop.check.finding import in_words, titled
from fleetloop.in_process import InProcessRun
from fleetloop.launch import placement, wall_time
from fleetloop.launch.accounts import stats_of
from fleetloop.launch.fault_ledger import FaultLedger
from fleetloop.launch.process_run import ProcessRun
from fleetloop.record.background import BackgroundWriter
from fleetloop.record.events_file import EVENTS, events_file
from fleetloop.record.reader import Record
from fleetloop.record.run_record import RunRecord
from fleetloop.record.scan import RecordError
from fleetloop.results import run_folder
from fleetloop.results.expectations import out_of_reach
from fleetloop.results.junit import write_junit
from fleetloop.results.outcome import Outcome, of_error, of_summary, unbegun
from fleetloop.results.summary import RunStats, Summary, summarise, to_json
from fleetloop.results.tables import print_report, print_results
from fleetloop.signals import stop_on_signals
from fleetloop.terminal import RunProgress, note, say_json

EXIT_STATUS = {
    "held": ExitStatus.OK,
    "failed": ExitStatus.FAILED,
    "not checked": ExitStatus.FAILED,
    "aborted": ExitStatus.INFRASTRUCTURE,
    "interrupted": ExitStatus.INTERRUPTED,
}
"""By the verdict of a run, or by how it ended."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Options of the command line for a run."""

    in_process: bool = False
    speed: float = 0.0
    overrides: Overrides = ()
    out: Path | None = None
    as_json: bool = False
    figures: bool = True
    profile: bool = False
    deployment: Path | None = None
    allow_unchecked: bool = False
    force: bool = False
    """Run what `fleetloop check` calls an error."""
    junit: Path | None = None


class _Live(NamedTuple):
    """Says what happens while a run goes on."""

    progress: RunProgress
    period_ns: int

    def on_progress(self, state: Progress) -> None:
        """Show how far it is."""
        self.progress.show(state.t_ns * 1e-9, state.wall_ns * 1e-9)

    def on_event(self, event: Event) -> None:
        """Tell an event that is a notice."""
        if KINDS[event.kind].told:
            self.progress.notice(f"{event.source}: {told(event, self.period_ns)}")

    def on_notice(self, process: str, text: str) -> None:
        """Tell something else of a process."""
        self.progress.notice(f"{short_name(process)}: {text}")


class _Teller:
    """Tells the outcome of a run once: as JSON on standard output, in a JUnit file."""

    def __init__(self, source: str, options: RunOptions) -> None:
        self._source, self._options = source, options
        self.told = False

    def tell(self, outcome: Outcome) -> int:
        """Tell the outcome as the options want it; return the exit status."""
        options, self.told = self._options, True
        if options.as_json:
            say_json(outcome)
        if options.junit is not None:
            allowed = options.allow_unchecked
            write_junit(options.junit, {self._source: outcome}, allow_unchecked=allowed)
        status: int = outcome["exit_status"]
        return status


def run_scenario(source: str, options: RunOptions) -> int:
    """Run a scenario, save and print its results; return the exit status.

    With `as_json` an error is told as an outcome, too, and not raised.

    Raises:
        ScenarioError: the scenario or an option is wrong; nothing was started.
        InfrastructureError: the run could not start.
    """
    teller = _Teller(source, options)
    try:
        return _run(source, options, teller)
    except FleetloopError as error:
        if teller.told:
            raise
        status = teller.tell(of_error(source, error))
        if options.as_json:
            return status
        raise


def _run(source: str, options: RunOptions, teller: _Teller) -> int:
    scenario = load(source, options.overrides)
    if options.in_process and scenario.clock.mode == "realtime":
        raise ScenarioError(
            f'{source}: clock.mode = "realtime" needs processes; add --clock lockstep to run it'
            " in one process"
        )
    if options.speed and scenario.clock.mode == "realtime":
        raise ScenarioError(
            f"--speed {options.speed:g}: real time has one speed; for lockstep only"
        )
    if options.in_process and (problem := process_fault_problem(scenario)):
        raise ScenarioError(f"{source}: {problem}, without --in-process")
    if options.in_process and options.deployment is not None:
        raise ScenarioError(
            f"--deployment {options.deployment}: --in-process has no buses and no network to place"
        )
    deployment = _deployment(scenario, options)
    if not options.in_process:
        keep_to_itself()
    _check_credentials(scenario, deployment)
    if long := wall_time.warning(scenario, speed=options.speed, in_process=options.in_process):
        note(long)
    for line in out_of_reach(scenario):
        note(f"{scenario.name}: {line}")
    _look_ahead(source, scenario, options)
    started_ns = SYSTEM_CLOCK.wall_ns()
    created = run_folder.create(scenario.name, options.out, started_ns)
    folder = created.path
    with (
        stop_on_signals() as stop,
        RunProgress(scenario.name, scenario.ends_at_s, quiet=options.as_json) as progress,
    ):
        live = _Live(progress, schedule(scenario).period_ns)
        try:
            run_folder.write(folder / run_folder.SCENARIO, to_toml(scenario))
            if options.in_process:
                stats = run_in_process(scenario, folder, live.on_progress, live.on_event, stop)
            else:
                run = ProcessRun(
                    scenario,
                    run=f"{folder.name}-{SYSTEM_CLOCK.monotonic_ns() % 1_000_000:06d}",
                    record=folder / run_folder.RECORD,
                    speed=options.speed,
                    profile=options.profile,
                    on_progress=live.on_progress,
                    on_event=live.on_event,
                    on_notice=live.on_notice,
                    deployment=deployment,
                )
                stats = stats_of(
                    run.run(stop),
                    realtime=scenario.clock.mode == "realtime",
                    period_s=scenario.clock.control_period_s,
                )
        except InfrastructureError:
            run_folder.discard(created)
            raise
    if not stats.began:
        run_folder.discard(created)
        note(f"{stats.ended}: {stats.reason}; the run did not begin")
        return teller.tell(
            unbegun(scenario.name, stats.ended, stats.reason, EXIT_STATUS[stats.ended])
        )
    stats.started = local_date(started_ns).isoformat()
    return _finish(scenario, folder, stats, options, teller)


def _look_ahead(source: str, scenario: Scenario, options: RunOptions) -> None:
    """Say what `fleetloop check` has against a scenario, but for its rehearsal: here is the run.

    Raises:
        ScenarioError: a necessary condition fails; named.
    """
    examined = examine(source, scenario, options.overrides)
    found = [finding for finding in examined if finding.level != "ok"]
    for line in in_words(found):
        note(line)
    failed = list(dict.fromkeys(titled(one) for one in found if one.level == "error"))
    if failed and not options.force:
        raise ScenarioError(
            f"{source}: would not work as it is, by {'; '.join(failed)};"
            " --force runs it all the same"
        )


def _check_credentials(scenario: Scenario, deployment: Deployment) -> None:
    """Refuse what can't be authenticated, and name the guests that are kept out."""
    placement.check_credentials(scenario, deployment)
    for user, why in placement.kept_out(deployment).items():
        note(f"{user}: kept out: {why}")


def _deployment(scenario: Scenario, options: RunOptions) -> Deployment:
    if options.deployment is None:
        return Deployment()
    return load_deployment(options.deployment, scenario)


def run_in_process(
    scenario: Scenario,
    folder: Path,
    on_progress: Callable[[Progress], None],
    on_event: Callable[[Event], None],
    stop: Stop,
) -> RunStats:
    """Run all roles in this process and write the record into the run's folder.

    Raises:
        InfrastructureError: the record can't be written, or the run could not start.
    """
    network = NetworkLink("in-process", "", "", "")
    began = SYSTEM_CLOCK.monotonic_s()
    record = folder / run_folder.RECORD
    period_ns = schedule(scenario).period_ns
    run: InProcessRun | None = None
    ended, reason = "completed", ""
    try:
        with (
            RunRecord(
                record,
                {robot.name: signals_of(scenario, robot) for robot in scenario.robot},
                to_toml(scenario),
                period_ns,
                buses=scenario.buses,
                formats=scenario.bus.record,
                inputs=scenario.names if scenario.records_inputs else (),
            ) as file,
            BackgroundWriter(file) as writer,
        ):
            run = InProcessRun(
                plant_brief(scenario, network=network),
                [agent_brief(scenario, r, network=network, bus=()) for r in scenario.names],
                leader_brief(scenario),
                writer,
                on_progress,
                on_event,
            )
            startup_s = SYSTEM_CLOCK.monotonic_s() - began
            run.run(stop)
    except InfrastructureError as error:
        if run is None:
            raise
        ended, reason = "aborted", str(error)
    if stop.requested:
        ended, reason = "interrupted", stop.reason
    return RunStats(
        mode="in-process",
        ended=ended,
        began=any(run.frames.values()),
        reason=reason,
        wall_s=run.wall_s,
        startup_s=startup_s,
        frames_per_bus=run.frames,
        nodes=run.nodes,
        stopped_robots=run.stopped_robots,
        faults=FaultLedger(scenario).rows(run.ticks),
        events=run.events,
        remarks=run.remarks,
        messages=run.messages,
    )


def _finish(
    scenario: Scenario, folder: Path, stats: RunStats, options: RunOptions, teller: _Teller
) -> int:
    record = folder / run_folder.RECORD
    if not record.exists():
        gone = stats.reason or f"{record} is not there: the run's folder was removed or moved"
        raise InfrastructureError(gone)
    try:
        recorded = Record.open(record)
    except RecordError as error:
        note(f"{stats.ended}: {stats.reason}; {error}")
        ended = "aborted" if stats.ended == "completed" else stats.ended
        reason = f"{stats.reason}; {error}" if stats.reason else str(error)
        return teller.tell(unbegun(scenario.name, ended, reason, EXIT_STATUS[ended]))
    summary = summarise(recorded, scenario, stats)
    unsaved: InfrastructureError | None = None
    try:
        run_folder.write(folder / run_folder.SUMMARY, to_json(summary))
        events = in_order(stats.events, scenario.names)
        run_folder.write(folder / EVENTS, events_file(events, schedule(scenario).period_ns))
    except InfrastructureError as error:
        unsaved = error  # results first
    if not options.as_json:
        print_results(summary, folder)
    status = exit_status(summary, allow_unchecked=options.allow_unchecked)
    teller.tell(of_summary(summary, folder, status))
    if unsaved is not None:
        raise unsaved
    if options.figures and summary["ticks"]:
        from fleetloop.results.report import write_report

        page = write_report(folder, recorded)
        if not options.as_json:
            print_report(page)
    return status


def exit_status(summary: Summary, *, allow_unchecked: bool) -> int:
    """The exit status of a run; without expectations none can fail."""
    unchecked = summary["verdict"] == "not checked" and not summary["cut_short"]
    if unchecked and (allow_unchecked or not summary["expectations"]):
        return ExitStatus.OK
    return EXIT_STATUS[summary["verdict"]]
