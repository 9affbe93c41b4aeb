"""`fleetloop run`: one scenario from file to results."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from bridge.network.messages import Progress
from bridge.process.lifecycle import keep_to_itself
from configs.errors import ExitStatus, FleetloopError
from configs.events import KINDS, Event, told
from configs.loading import load
from configs.overrides import Overrides
from configs.resolve import schedule
from configs.roles import short_name
from fleetloop.json_lines import JsonLines
from fleetloop.launch.conclusion import Concluded, conclude
from fleetloop.launch.conduct import (
    Listener,
    Manner,
    Start,
    carry_out,
    prepare,
)
from fleetloop.launch.fork_server import ForkServer
from fleetloop.launch.run_lines import RunLines
from fleetloop.record.scan import RecordError
from fleetloop.results.junit import write_junit
from fleetloop.results.outcome import Outcome, of_error, of_summary, unbegun
from fleetloop.results.summary import Summary
from fleetloop.results.tables import print_report, print_results
from fleetloop.signals import interruptible, stop_on_signals
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
    live: bool = False
    overrides: Overrides = ()
    out: Path | None = None
    as_json: bool = False
    json_lines: bool = False
    figures: bool = True
    profile: bool = False
    deployment: Path | None = None
    allow_unchecked: bool = False
    force: bool = False
    """Run what `fleetloop check` calls an error."""
    junit: Path | None = None

    @property
    def for_programs(self) -> bool:
        """Whether standard output is JSON."""
        return self.as_json or self.json_lines


class _Live(NamedTuple):
    """Says what happens while a run goes on."""

    progress: RunProgress
    period_ns: int

    @property
    def listener(self) -> Listener:
        """To be told of the run."""
        return Listener(self.on_progress, self.on_event, self.on_notice, self.on_start)

    def on_start(self, start: Start) -> None:
        """Know where the robots are seen."""
        self.progress.robots = start.robots

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
        self.lines = JsonLines() if options.json_lines else None
        self.begun = self.told = False

    def tell(self, outcome: Outcome) -> int:
        """Tell the outcome as the options want it; return the exit status."""
        options, self.told = self._options, True
        if options.as_json:
            say_json(outcome)
        if self.lines is not None:
            self.lines.say("outcome", scenario=self._source, outcome=outcome)
            self.lines.end()
        if options.junit is not None:
            allowed = options.allow_unchecked
            write_junit(options.junit, {self._source: outcome}, allow_unchecked=allowed)
        status: int = outcome["exit_status"]
        return status


@interruptible
def run_scenario(
    source: str,
    options: RunOptions,
    *,
    interrupted: bool = False,
    fork_server: ForkServer | None = None,
) -> int:
    """Run a scenario, save and print its results; return the exit status.

    Where standard output is JSON an error is told as an outcome, too, and not raised; so is Ctrl-C
    before or after the run itself, which ends in order.

    Args:
        source: name or file of the scenario.
        options: of the command line.
        interrupted: Ctrl-C came before this.
        fork_server: one that was started before; default: one is started.

    Raises:
        ScenarioError: the scenario or an option is wrong; nothing was started.
        InfrastructureError: the run could not start.
    """
    teller = _Teller(source, options)
    try:
        return _run(source, options, teller, fork_server, interrupted=interrupted)
    except FleetloopError as error:
        if teller.told:
            raise
        status = teller.tell(of_error(source, error))
        if options.for_programs:
            return status
        raise
    except KeyboardInterrupt:
        if teller.told:
            return ExitStatus.INTERRUPTED
        reason = f"interrupted {'before it had results' if teller.begun else 'before it began'}"
        note(f"{source}: {reason}")
        return teller.tell(unbegun(source, "interrupted", reason, ExitStatus.INTERRUPTED))


def _run(
    source: str,
    options: RunOptions,
    teller: _Teller,
    fork_server: ForkServer | None,
    *,
    interrupted: bool,
) -> int:
    if interrupted:
        raise KeyboardInterrupt
    scenario = load(source, options.overrides)
    manner = Manner(
        in_process=options.in_process,
        speed=options.speed,
        deployment=options.deployment,
        profile=options.profile,
        live=options.live,
        force=options.force,
    )
    if not options.in_process:
        keep_to_itself()
    told = None if teller.lines is None else RunLines(teller.lines, scenario)
    say = note if told is None else partial(told.note, "check")
    deployment = prepare(source, scenario, manner, say, overrides=options.overrides)
    with (
        stop_on_signals() as stop,
        RunProgress(scenario.name, scenario.ends_at_s, quiet=options.for_programs) as progress,
    ):
        live = _Live(progress, schedule(scenario).period_ns)
        listener = live.listener if told is None else told.listener
        teller.begun = True
        carried = carry_out(scenario, options.out, manner, deployment, listener, stop, fork_server)
    ended, reason = carried.stats.ended, carried.stats.reason
    if not carried.stats.began:
        note(f"{ended}: {reason}; the run did not begin")
        return teller.tell(unbegun(scenario.name, ended, reason, EXIT_STATUS[ended]))
    try:
        concluded = conclude(scenario, carried)
    except RecordError as error:
        note(f"{ended}: {reason}; {error}")
        ended = "aborted" if ended == "completed" else ended
        reason = f"{reason}; {error}" if reason else str(error)
        return teller.tell(unbegun(scenario.name, ended, reason, EXIT_STATUS[ended]))
    return _show(concluded, carried.folder, options, teller)


def _show(concluded: Concluded, folder: Path, options: RunOptions, teller: _Teller) -> int:
    record, summary, unsaved = concluded
    if not options.for_programs:
        print_results(summary, folder)
    status = exit_status(summary, allow_unchecked=options.allow_unchecked)
    teller.tell(of_summary(summary, folder, status))
    if unsaved is not None:
        raise unsaved
    if options.figures and summary["ticks"]:
        from fleetloop.results.report import write_report

        page = write_report(folder, record)
        if not options.for_programs:
            print_report(page)
    return status


def exit_status(summary: Summary, *, allow_unchecked: bool) -> int:
    """The exit status of a run; without expectations none can fail."""
    unchecked = summary["verdict"] == "not checked" and not summary["cut_short"]
    if unchecked and (allow_unchecked or not summary["expectations"]):
        return ExitStatus.OK
    return EXIT_STATUS[summary["verdict"]]
