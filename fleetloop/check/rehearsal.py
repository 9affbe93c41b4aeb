"""A rehearsal: the beginning of the run in this process, for a second or two of processor time.

It has what closed forms leave out: saturation, starts far off, arming, limits of host and drives.
It is the run itself, with the run's own controllers, drives and bodies, but nothing is recorded, so
short scenarios are rehearsed to their end.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bridge.network.messages import Progress
from bridge.process.lifecycle import Stop
from configs.connections import NetworkLink
from configs.errors import FleetloopError
from configs.resolve import agent_brief, leader_brief, plant_brief, schedule, signals_of
from configs.scenario import Scenario
from fleetloop.check.finding import Finding
from fleetloop.in_process.run import InProcessRun
from fleetloop.record.memory import MemoryRecord
from fleetloop.settling import LOST_M, SETTLE_BAND

WORK_S = 1.5
"""Processor time that is meant to be enough, on an ordinary machine."""
_TICK_S, _SUBSTEP_S, _WIRE_S = 40e-6, 20e-6, 250e-6
"""Of a robot: a tick, a step of its motors and encoders, a tick on a bus with bit timing."""
FINAL_S = 4.0
"""Its end, where errors should be small: shorter than a run's, as a rehearsal is."""
_TITLE = "rehearsal"


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What a run in this process came to."""

    rows: Mapping[str, np.ndarray]
    """Of each robot's controller, one a tick, by signal."""
    stopped: Mapping[str, str]
    """Robots that stopped themselves, and why."""
    failed: str = ""
    """Why the run ended."""


def rehearse(scenario: Scenario) -> list[Finding]:
    """Run the beginning of a scenario; return its findings."""
    if scenario.host.dry_run:
        return [Finding("ok", _TITLE, "none: host.dry_run")]
    until_s = _affordable_s(scenario)
    seen = rehearsal(scenario, until_s)
    if seen.failed:
        return [Finding("error", _TITLE, f"the run would end: {seen.failed}")]
    whole = until_s >= scenario.ends_at_s - 1e-9
    said = f"all {until_s:g} s" if whole else f"first {until_s:.3g} s"
    found = [
        Finding("error", _TITLE, f"{said}: stops itself at {reason}", (robot,))
        for robot, reason in seen.stopped.items()
    ]
    if not found:
        period_s = schedule(scenario).period_s
        rows = {r: part[scenario.members[r].ticks] for r, part in seen.rows.items()}
        end = round(until_s / period_s)
        stayed = [r for r, member in scenario.members.items() if member.leaves_tick >= end]
        found = _errors(stayed, rows, period_s, said, whole=whole)
    return found or [Finding("ok", _TITLE, f"{said}: no robot stops")]


def rehearsal(scenario: Scenario, until_s: float) -> Rehearsal:
    """Run a scenario in this process up to a time; it ends when all robots have stopped."""
    part = _part(scenario, until_s)
    memory = MemoryRecord()
    network = NetworkLink("in-process", "", "", "")
    stop = Stop()

    def watch(_: Progress) -> None:
        if len(run.stopped_robots) == len(part.robot):
            stop.request("all robots have stopped")

    try:
        run = InProcessRun(
            plant_brief(part, network=network),
            [agent_brief(part, name, network=network, bus=()) for name in part.names],
            leader_brief(part),
            memory,
            watch,
        )
        run.run(stop)
    except FleetloopError as error:
        return Rehearsal({}, {}, str(error))
    rows = {
        robot.name: memory.rows(robot.name, "controller", signals_of(part, robot))
        for robot in part.robot
    }
    return Rehearsal(rows, run.stopped_robots)


def _affordable_s(scenario: Scenario) -> float:
    """Scenario time that `WORK_S` is enough for, whole ticks."""
    h, substeps = scenario.clock.control_period_s, 1
    tick_s = _TICK_S
    if scenario.drive.preset == "realistic":
        substeps = max(1, round(h / scenario.clock.plant_step_s))
        tick_s += substeps * _SUBSTEP_S
    if scenario.bus.timing == "wire":
        tick_s += _WIRE_S
    ticks = max(int(WORK_S / tick_s / len(scenario.robot)), 1)
    return min(ticks * h, scenario.ends_at_s)


def _part(scenario: Scenario, until_s: float) -> Scenario:
    clock = replace(scenario.clock, mode="lockstep")
    bus = replace(scenario.bus, record=())
    return scenario.model_copy(update={"clock": clock, "bus": bus, "until_s": until_s})


def _errors(
    names: Sequence[str],
    rows: Mapping[str, np.ndarray],
    period_s: float,
    said: str,
    *,
    whole: bool,
) -> list[Finding]:
    """Those of `names` that are off their paths, or apart, at the end of the rehearsal."""
    found = []
    last = {
        robot: rows[robot][_final(rows[robot], period_s) :] for robot in names if len(rows[robot])
    }
    for robot, part in last.items():
        error, before = _off(part), _off(rows[robot][:1])
        settled = error <= SETTLE_BAND if whole else error <= max(before, LOST_M)
        if settled:
            continue
        text = f"{said}: {error:.2g} m off its path at the end, {before:.2g} m at the start"
        found.append(
            Finding("error" if whole and error > LOST_M else "warning", _TITLE, text, (robot,))
        )
    if whole and last and (apart := _apart(last)) > SETTLE_BAND:
        text = f"{said}: path variables {apart:.2g} m apart at the end"
        found.append(Finding("warning", _TITLE, text))
    return found


def _final(rows: np.ndarray, period_s: float) -> int:
    return max(len(rows) - round(min(FINAL_S / period_s, 0.25 * len(rows))) - 1, 0)


def _off(rows: np.ndarray) -> float:
    """Largest |x_e| or |y_e| [m]; infinite if it isn't a number."""
    values = np.abs(np.stack([rows["x_e_m"], rows["y_e_m"]]))
    return float(values.max()) if np.isfinite(values).all() else np.inf


def _apart(last: Mapping[str, np.ndarray]) -> float:
    count = min(len(part) for part in last.values())
    s = np.stack([part["s"][-count:] for part in last.values()])
    return float((s.max(axis=0) - s.min(axis=0)).max())
