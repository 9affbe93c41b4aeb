"""What the processes of a run reported at their end, put together for the summary."""

from bridge.awake import AFTERMATH_S, Stall
from bridge.network.messages import Report
from configs.deployment import agent_role
from fleetloop.launch.process_run import Outcome
from fleetloop.results.summary import RunStats

MOST_NOTICES = 200
"""Of one process; what else it says is in nobody's interest."""


def stats_of(outcome: Outcome, *, realtime: bool, period_s: float) -> RunStats:
    """What the launcher saw and what all processes reported at their end."""
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
    )
    stats.cpu_s["launcher"] = round(outcome.cpu_ns * 1e-9, 3)
    for process, report in outcome.reports.items():
        waits = {
            name.removesuffix("_ns"): round(report.number(name) * 1e-9, 4)
            for name in report.values
            if name.endswith("_ns") and name != "cpu_ns"
        }
        if profile := {
            name.removeprefix("profile."): report.number(name) * 1e-9
            for name in report.values
            if name.startswith("profile.") and report.number(name)
        }:
            stats.profile_s[process] = profile
        if waits:
            stats.waits_s[process] = waits
        if "cpu_ns" in report.values:
            stats.cpu_s[process] = round(report.number("cpu_ns") * 1e-9, 3)
        if "misses" in report.values:
            counts = {name: int(report.number(name)) for name in ("misses", "skipped")}
            stats.realtime[process.removeprefix("agent/")] = counts
        stats.refused |= set(filter(None, str(report.values.get("refused", "")).split(", ")))
        if process == "plant":
            stats.overruns = int(report.number("overruns"))
            stats.frames_per_bus = {
                bus: int(report.number(f"frames.{bus}")) for bus in _under("frames.", report)
            }
            stats.bus_troubles = _under("trouble.", report)
        if early := report.values.get("early"):
            stats.left_early[process.removeprefix("agent/")] = str(early)
        if stopped := report.values.get("stopped"):
            stats.stopped_robots[process.removeprefix("agent/")] = str(stopped)
        if notices := report.values.get("notices"):
            lines = str(notices).split("\n")
            stats.notices[process.removeprefix("agent/")] = lines[:MOST_NOTICES]
    # What a process said on the way is in its report as well, if it lived to make one.
    lost = {name: said for name, said in outcome.said.items() if name not in outcome.reports}
    for process, said in (*lost.items(), *outcome.notices.items()):
        stats.notices.setdefault(process.removeprefix("agent/"), []).extend(said)
    if (plant := outcome.reports.get("plant")) is not None:
        _blame_stalls(outcome, stats, plant, period_s)
        stats.stopped_robots |= _under("stopped.", plant)  # the cause of what its controller says
    return stats


def _blame_stalls(outcome: Outcome, stats: RunStats, plant: Report, period_s: float) -> None:
    """Who stopped soon after the plant stood still stopped because of that."""
    stalls = [
        Stall(int(tick), plant.number(f"stall.{tick}"))
        for tick in _under("stall.", plant)
        if tick.removeprefix("-").isdecimal()
    ]
    stats.machine["plant_stalls"] = [
        {"t_s": round(stall.tick * period_s, 6), "lasted_s": round(stall.lasted_s, 3)}
        for stall in stalls
    ]
    for robot, reason in stats.stopped_robots.items():
        report = outcome.reports.get(agent_role(robot), Report({}))
        tick = report.number("stopped_tick")
        for stall in stalls:
            behind = (stall.lasted_s + AFTERMATH_S) / period_s
            if stall.tick - stall.lasted_s / period_s <= tick <= stall.tick + behind:
                stats.stopped_robots[robot] = (
                    f"{reason}; the plant, or its machine, stalled for {stall.lasted_s:.2f} s at"
                    f" t = {stall.tick * period_s:g} s"
                )


def _under(prefix: str, report: Report) -> dict[str, str]:
    """What a report says under names that begin alike, by the rest of the name."""
    return {
        name.removeprefix(prefix): str(value)
        for name, value in report.values.items()
        if name.startswith(prefix)
    }
