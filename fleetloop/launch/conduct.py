"""A run from its scenario to its record, whoever asks for it: the command, a program, a job.

prepare     what is wrong with it, before anything is started
carry_out   the run: its folder, its processes or none, its statistics

Its summary is made by `fleetloop.launch.conclusion`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from bridge.network.messages import Progress
from bridge.process.clock import SYSTEM_CLOCK, local_date
from bridge.process.lifecycle import Stop
from configs.connections import NetworkLink
from configs.deployment import Deployment, load_deployment
from configs.errors import InfrastructureError, ScenarioError
from configs.events import Event
from configs.faults.plan import process_fault_problem
from configs.loading import to_toml
from configs.overrides import Overrides
from configs.resolve import agent_brief, leader_brief, plant_brief, schedule, signals_of
from configs.scenario import Scenario
from fleetloop.check.examine import examine
from fleetloop.check.finding import in_words, titled
from fleetloop.foxglove.layout import layout_of
from fleetloop.in_process.run import InProcessRun
from fleetloop.launch import placement, wall_time
from fleetloop.launch.accounts import stats_of
from fleetloop.launch.drawn import drawing
from fleetloop.launch.fault_ledger import FaultLedger
from fleetloop.launch.fork_server import ForkServer
from fleetloop.launch.process_run import ProcessRun
from fleetloop.launch.viewer import NO_VIEWER
from fleetloop.record.background import BackgroundWriter
from fleetloop.record.run_record import RunRecord
from fleetloop.results import run_folder
from fleetloop.results.expectations import out_of_reach
from fleetloop.results.summary import RunStats
from fleetloop.robot_states import RobotState


@dataclass(frozen=True, slots=True, kw_only=True)
class Manner:
    """How a scenario is run."""

    in_process: bool = False
    speed: float = 0.0
    """Multiple of real time to hold a lockstep run to; 0: as fast as the machine allows."""
    deployment: Path | None = None
    profile: bool = False
    live: bool = False
    """With a viewer from the start, whose address is told as a notice."""
    force: bool = False
    """Run what `fleetloop check` calls an error."""


class Start(NamedTuple):
    """A run that begins."""

    folder: Path
    run: str
    """Its name, by which its door and its buses are found; "" in process."""
    processes: tuple[str, ...]  # besides the launcher
    robots: Callable[[], Sequence[RobotState]]
    """Gives what is to be seen of the robots."""


class Listener(NamedTuple):
    """Told of a run while it goes on."""

    on_progress: Callable[[Progress], None]
    on_event: Callable[[Event], None]
    on_notice: Callable[[str, str], None]
    """Of a process, in words."""
    on_start: Callable[[Start], None] = lambda _: None
    """Before everything else."""


class Words(NamedTuple):
    """What a caller calls the options of `Manner`; the default is the command line."""

    in_process: str = "--in-process"
    live: str = "--live"
    lockstep: str = "--clock lockstep"
    speed: str = "--speed"
    deployment: str = "--deployment"
    force: str = "--force"
    notes_are_told: bool = True
    """Notes come before an error."""


OF_OPTIONS = Words()


def prepare(
    source: str,
    scenario: Scenario,
    manner: Manner,
    note: Callable[[str], None],
    *,
    overrides: Overrides = (),
    words: Words = OF_OPTIONS,
) -> Deployment:
    """Refuse what can't be run so; note what `fleetloop check` has against it.

    Args:
        source: the scenario's name in messages.
        scenario: to be run.
        manner: how.
        note: told a line for each thing to mind.
        overrides: what options set in the scenario.
        words: what the caller calls these options.

    Returns:
        The deployment.

    Raises:
        ScenarioError: scenario, manner and deployment don't go together, or a necessary condition
            fails.
    """
    _refuse(source, scenario, manner, words)
    deployment = deployment_of(scenario, manner)
    if manner.live and placement.is_external(deployment):
        raise ScenarioError(
            f"{words.live} with {words.deployment} {manner.deployment}: {NO_VIEWER}"
        )
    placement.check_credentials(scenario, deployment)
    for user, why in placement.kept_out(deployment).items():
        note(f"{user}: kept out: {why}")
    if long := wall_time.warning(scenario, speed=manner.speed, in_process=manner.in_process):
        note(long)
    for line in out_of_reach(scenario):
        note(f"{scenario.name}: {line}")
    # But for the rehearsal: here is the run.
    found = [one for one in examine(source, scenario, overrides) if one.level != "ok"]
    for line in in_words(found):
        note(line)
    errors = [one for one in found if one.level == "error"]
    if errors and not manner.force:
        failed = "; ".join(dict.fromkeys(map(titled, errors)))
        text = f"{source}: would not work as it is, by {failed}; {words.force} runs it all the same"
        raise ScenarioError(text if words.notes_are_told else "\n".join([text, *in_words(errors)]))
    return deployment


def _refuse(source: str, scenario: Scenario, manner: Manner, words: Words) -> None:
    """Refuse options that don't go together."""
    realtime = scenario.clock.mode == "realtime"
    if manner.in_process and realtime:
        raise ScenarioError(
            f'{source}: clock.mode = "realtime" needs processes; add {words.lockstep} to run it'
            " in one process"
        )
    if manner.speed and realtime:
        raise ScenarioError(
            f"{words.speed} {manner.speed:g}: real time has one speed; for lockstep only"
        )
    if manner.in_process and (problem := process_fault_problem(scenario)):
        raise ScenarioError(f"{source}: {problem}, without {words.in_process}")
    if manner.in_process and manner.live:
        raise ScenarioError(f"{words.live}: {words.in_process} has no viewer")
    if manner.in_process and manner.deployment is not None:
        raise ScenarioError(
            f"{words.deployment} {manner.deployment}: {words.in_process} has no buses and no"
            " network to place"
        )
    if manner.in_process and manner.speed:
        raise ScenarioError(
            f"{words.speed} {manner.speed:g}: {words.in_process} runs as fast as it can"
        )


def deployment_of(scenario: Scenario, manner: Manner) -> Deployment:
    """Where roles and buses are.

    Raises:
        ScenarioError: its file is wrong, or not for this scenario.
    """
    if manner.deployment is None:
        return Deployment()
    return load_deployment(manner.deployment, scenario)


class Carried(NamedTuple):
    """A run that has ended."""

    folder: Path
    stats: RunStats
    close: Callable[[], None] = lambda: None
    """Ends what outlives the run until its summary is written."""


def carry_out(
    scenario: Scenario,
    out: Path | None,
    manner: Manner,
    deployment: Deployment,
    listener: Listener,
    stop: Stop,
    fork_server: ForkServer | None = None,
) -> Carried:
    """Run a scenario that was prepared, into a folder `out` or one of its own.

    A run of which nothing could be recorded leaves no folder: its statistics say that it did not
    begin. A fork server that was started before takes part; else one is started.

    Raises:
        ScenarioError: `out` exists and isn't empty.
        InfrastructureError: the run could not start.
    """
    started_ns = SYSTEM_CLOCK.wall_ns()
    created = run_folder.create(scenario.name, out, started_ns)
    folder = created.path
    try:
        run_folder.write(folder / run_folder.SCENARIO, to_toml(scenario))
        run_folder.write(folder / run_folder.LAYOUT, layout_of(scenario))
        if manner.in_process:
            carried = Carried(folder, run_in_process(scenario, folder, listener, stop))
        else:
            carried = _run_over_processes(
                scenario, folder, manner, deployment, listener, stop, fork_server
            )
    except InfrastructureError:
        run_folder.discard(created)
        raise
    if not carried.stats.began:
        carried.close()
        run_folder.discard(created)
    carried.stats.started = local_date(started_ns).isoformat()
    return carried


def _run_over_processes(
    scenario: Scenario,
    folder: Path,
    manner: Manner,
    deployment: Deployment,
    listener: Listener,
    stop: Stop,
    fork_server: ForkServer | None,
) -> Carried:
    name = f"{folder.name}-{SYSTEM_CLOCK.monotonic_ns() % 1_000_000:06d}"
    run = ProcessRun(
        scenario,
        run=name,
        record=folder / run_folder.RECORD,
        speed=manner.speed,
        profile=manner.profile,
        on_progress=listener.on_progress,
        on_event=listener.on_event,
        on_notice=listener.on_notice,
        deployment=deployment,
        live=manner.live,
        fork_server=fork_server,
    )
    listener.on_start(Start(folder, run.name, run.processes, run.robots))
    stats = stats_of(
        run.run(stop),
        realtime=scenario.clock.mode == "realtime",
        period_s=scenario.clock.control_period_s,
    )
    return Carried(folder, stats, run.close)


def run_in_process(
    scenario: Scenario,
    folder: Path,
    listener: Listener,
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
                drawing=drawing(scenario),
            ) as file,
            BackgroundWriter(file) as writer,
        ):
            run = InProcessRun(
                plant_brief(scenario, network=network),
                [agent_brief(scenario, r, network=network, bus=()) for r in scenario.names],
                leader_brief(scenario),
                writer,
                listener.on_progress,
                listener.on_event,
            )
            listener.on_start(Start(folder, "", (), run.robots))
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
