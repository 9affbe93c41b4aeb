"""The statistics of a run over processes, from the reports of its processes."""

from bridge.network.reports import AgentReport, PlantReport, Report
from bridge.network.router import LauncherLink
from bridge.process.awake import AFTERMATH_S
from configs.roles import AGENT, LAUNCHER, PLANT, short_name
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.message_reader import of_process
from fleetloop.launch.outcome import Outcome
from fleetloop.results.summary import RunStats

MOST_REMARKS = 200
"""Remarks kept of one process; further ones are dropped."""


def stats_of(outcome: Outcome, *, realtime: bool, period_s: float) -> RunStats:
    """Statistics from the launcher's observations and the final reports of all processes."""
    stats = RunStats(
        mode="realtime" if realtime else "lockstep",
        ended=outcome.ended,
        began=outcome.startup_s > 0.0,
        reason=outcome.reason,
        timed=outcome.timed,
        wall_s=outcome.wall_s,
        startup_s=outcome.startup_s,
        teardown_s=outcome.teardown_s,
        machine=outcome.machine,
        refused=outcome.refused,
        faults=outcome.faults,
        steered=outcome.steered,
        clocks=outcome.clocks,
    )
    stats.cpu_s["launcher"] = round(outcome.cpu_ns * 1e-9, 3)
    # The plant's first: what it does to a robot at a tick comes before what the controller says.
    for process, events in outcome.former.items():
        stats.events += [of_process(process, event) for event in events]
    for process, report in sorted(outcome.reports.items(), key=lambda it: it[0] != PLANT.name):
        _add_report(stats, process, report)
    # What a process said on the way is in its report as well, if it lived to make one.
    lost = {name: said for name, said in outcome.said.items() if name not in outcome.reports}
    for process, log in (*lost.items(), *outcome.events.items()):
        stats.events += log.kept
        if remarks := log.remarks():
            stats.remarks.setdefault(short_name(process), []).extend(remarks)
    for process, remarks in outcome.remarks.items():
        stats.remarks.setdefault(process, []).extend(remarks)
    plant = outcome.reports.get(PLANT.name)
    if isinstance(plant, PlantReport):
        _blame_stalls(outcome, stats, plant, period_s)
        stats.stopped_robots |= plant.stopped_robots  # the cause of what its controller says
    return stats


def _add_report(stats: RunStats, process: str, report: Report) -> None:
    name = short_name(process)
    stats.cpu_s[process] = round(report.cpu_ns * 1e-9, 3)
    stats.missing_privileges |= set(report.missing_privileges)
    if profile := {part: ns * 1e-9 for part, ns in report.profile_ns.items() if ns}:
        stats.profile_s[process] = profile
    if report.durations_ns:
        waits = report.durations_ns.items()
        stats.waits_s[process] = {wait: round(ns * 1e-9, 4) for wait, ns in waits}
    if report.left_early:
        stats.left_early[name] = report.left_early
    stats.events += [of_process(process, event) for event in report.events]
    if report.remarks:
        stats.remarks[name] = list(report.remarks[:MOST_REMARKS])
    match report:
        case PlantReport():
            stats.overruns = report.overruns
            stats.frames_per_bus = dict(report.frames)
            stats.bus_troubles = dict(report.bus_troubles)
            stats.nodes = report.nodes
        case AgentReport():
            if report.messages:
                stats.messages[name] = report.messages
            if report.deadlines is not None:
                stats.realtime[name] = report.deadlines._asdict()
            if report.stop_reason:
                stats.stopped_robots[name] = report.stop_reason


def _blame_stalls(outcome: Outcome, stats: RunStats, plant: PlantReport, period_s: float) -> None:
    """Name a stall of the plant as the cause of stops soon after it."""
    stats.machine["plant_stalls"] = [
        {"t_s": round(stall.tick * period_s, 6), "lasted_s": round(stall.lasted_s, 3)}
        for stall in plant.stalls
    ]
    for robot, reason in stats.stopped_robots.items():
        report = outcome.reports.get(AGENT.process(robot))
        tick = report.stop_tick if isinstance(report, AgentReport) else 0
        for stall in plant.stalls:
            behind = (stall.lasted_s + AFTERMATH_S) / period_s
            if stall.tick - stall.lasted_s / period_s <= tick <= stall.tick + behind:
                stats.stopped_robots[robot] = (
                    f"{reason}; the plant, or its machine, stalled for {stall.lasted_s:.2f} s at"
                    f" t = {stall.tick * period_s:g} s"
                )


def complete(plane: ControlPlane, link: LauncherLink) -> None:
    """Add what router, clocks and the launcher's own reading say of a run that has ended."""
    outcome, words = plane.outcome, plane.words
    if refusals := link.denials.notes():
        outcome.remarks["router"] = refusals
    outcome.clocks = plane.clocks.account()
    outcome.refused = link.denials.counts()
    words.note_dropped(link.dropped())
    if refusals := words.refusals.lines():
        outcome.remarks[LAUNCHER.name] = refusals
    # A process that floods the others is the cause of whatever was too late.
    said = {name for report in outcome.reports.values() for name in report.flooders}
    floods = sorted(said.union(words.refusals.floods()))
    floods += [f"{user} (cut off by the router)" for user in sorted(link.denials.flooders)]
    if floods and outcome.ended == "aborted":
        outcome.reason += f"; flooded by {', '.join(floods)}"
