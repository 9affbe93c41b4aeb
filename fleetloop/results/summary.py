"""The summary of a run: settle times, errors, spread, cost, and whether its expectations held."""

import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from configs.compiled import WHY_PURE
from configs.events import KINDS, Event, in_order, told
from configs.leader_speed import corners, speed_at
from configs.membership import Membership
from configs.resolve import leader_brief
from configs.roles import LAUNCHER, RECORDER
from configs.scenario import Scenario
from fleetloop.record.reader import Record
from fleetloop.results import expectations
from fleetloop.results.derived import spread
from fleetloop.results.expectations import judge, why_not_checked
from fleetloop.results.network import network
from fleetloop.settling import FINAL_S, settle_s

ERRORS = ("x_e_m", "y_e_m", "theta_e_rad")
_PACKAGES = ("fleetloop", "eclipse-zenoh", "python-can", "numpy", "msgpack", "mcap", "pydantic")


@dataclass(slots=True)
class RunStats:
    """Facts about a run that its record can't hold."""

    mode: str  # "lockstep" over processes, or "in-process"
    started: str = ""  # wall clock, ISO 8601
    ended: str = "completed"  # "completed", "interrupted", "aborted"
    began: bool = True  # anything happened that could be recorded
    reason: str = ""
    timed: bool = True  # the reason says when
    wall_s: float = 0.0
    startup_s: float = 0.0
    teardown_s: float = 0.0
    overruns: int = 0
    frames_per_bus: dict[str, int] = field(default_factory=dict)
    nodes: Mapping[str, Mapping[str, int]] = field(default_factory=dict)  # of wires, by bus/node
    waits_s: dict[str, dict[str, float]] = field(default_factory=dict)
    stopped_robots: dict[str, str] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)  # of a source in their order
    events_known: bool = True
    faults: list[dict[str, Any]] = field(default_factory=list)  # of `fleetloop.launch.fault_ledger`
    steered: Scenario | None = None  # with the steps of v_r that were ordered; None: none was
    remarks: dict[str, list[str]] = field(default_factory=dict)  # on the whole run, by process
    clocks: dict[str, dict[str, float]] = field(default_factory=dict)  # offsets, by process
    refused: dict[str, dict[str, int]] = field(default_factory=dict)  # by kind, by identity
    messages: dict[str, Mapping[str, Mapping[str, int]]] = field(default_factory=dict)  # of edges
    machine: dict[str, Any] = field(default_factory=dict)  # of `fleetloop.launch.machine`
    bus_troubles: dict[str, str] = field(default_factory=dict)
    left_early: dict[str, str] = field(default_factory=dict)  # robots told to stop, by whom
    cpu_s: dict[str, float] = field(default_factory=dict)
    realtime: dict[str, dict[str, int]] = field(default_factory=dict)
    missing_privileges: set[str] = field(default_factory=set)
    profile_s: dict[str, dict[str, float]] = field(default_factory=dict)


Summary = dict[str, Any]
"""summary.json as it is written."""


def summarise(record: Record, scenario: Scenario, stats: RunStats) -> Summary:
    """The summary of a run, complete or not; of every robot all its own rows."""
    controllers = {robot: rows for robot, rows in record.controller.items() if len(rows)}
    ticks = max((len(rows) for rows in controllers.values()), default=0)
    events = in_order(stats.events, scenario.names)
    known = events if stats.events_known else None
    expected = [judge(expect, record, scenario, known) for expect in scenario.expect]
    cut_short = _cut_short(record, scenario, stats)
    verdict = stats.ended
    reason = stats.reason if stats.timed else f"{stats.reason}, after {ticks} ticks"
    if verdict == "completed":
        stopped = bool(stats.stopped_robots)
        verdict = expectations.verdict(expected, stopped=stopped, cut_short=bool(cut_short))
        if verdict == "not checked":
            reason = why_not_checked(expected, cut_short)
    longest = max(controllers.values(), key=len, default=None)
    v_r = np.empty(0) if longest is None else leader_speed(scenario)(_nanoseconds(longest["t_s"]))
    robots = {
        robot: _robot(rows, v_r, scenario.members[robot], scenario.clock.control_period_s)
        for robot, rows in controllers.items()
        if len(rows[scenario.members[robot].ticks])
    }
    simulated_s = round(ticks * scenario.clock.control_period_s, 9)
    return {
        "verdict": verdict,
        "reason": reason,
        "scenario": scenario.name,
        "mode": stats.mode,
        "started": stats.started,
        "ticks": ticks,
        "simulated_s": simulated_s,
        "wall_s": round(stats.wall_s, 4),
        "real_time_factor": round(simulated_s / stats.wall_s, 3) if stats.wall_s > 0 else None,
        "startup_s": round(stats.startup_s, 3),
        "teardown_s": round(stats.teardown_s, 3),
        "robots": robots,
        "worst": _worst(list(robots.values())),
        "s_spread": _spread_of(record.controller, scenario.members),
        "expectations": expected,
        "cut_short": cut_short,
        "record_lost": record.shortage(),
        "stopped_robots": {
            robot: stats.stopped_robots[robot]
            for robot in scenario.names
            if robot in stats.stopped_robots
        },
        "faults": stats.faults,
        "events": [
            {"tick": it.tick, "t_s": _seconds(it.tick * scenario.clock.control_period_s)}
            | {"source": it.source, "kind": it.kind, "text": it.text}
            for it in events
        ],
        "notices": _notices(events, stats.remarks, round(scenario.clock.control_period_s * 1e9)),
        "refused": stats.refused,
        "clock_offsets": stats.clocks,
        "network": network(controllers, stats.messages),
        "overruns": stats.overruns,
        "machine": stats.machine or None,
        "frames_per_bus": stats.frames_per_bus,
        "nodes": {node: dict(counts) for node, counts in stats.nodes.items()} or None,
        "bus_troubles": stats.bus_troubles,
        "waits_s": stats.waits_s,
        "cpu_s": stats.cpu_s,
        "profile_us_per_tick": _profile(stats, ticks),
        "realtime": _realtime(controllers, stats) if stats.realtime and ticks else None,
        "seed": scenario.seed,
        "compiled": not WHY_PURE,
        "versions": {"python": platform.python_version()}
        | {package: version(package) for package in _PACKAGES},
    }


def to_json(summary: Summary) -> str:
    """summary.json's text; a number that isn't finite, as after a law that diverged, is null."""
    return json.dumps(finite(summary), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def finite(value: Any) -> Any:
    """Tables and lists with None for every number that isn't finite."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _notices(
    events: list[Event], remarks: Mapping[str, list[str]], period_ns: int
) -> dict[str, list[str]]:
    """What people are told of each source of events and of each process, in words."""
    notices: dict[str, list[str]] = {}
    for event in events:
        if KINDS[event.kind].told:
            notices.setdefault(event.source, []).append(told(event, period_ns))
    for process, said in remarks.items():
        notices.setdefault(process, []).extend(said)
    return notices


def _seconds(t_s: float) -> float:
    """A time of the record without what is left of its multiplication."""
    return round(float(t_s), 9)


def _final(t: np.ndarray) -> slice:
    return slice(int(np.searchsorted(t, t[-1] - FINAL_S, side="right")), None)


def leader_speed(scenario: Scenario) -> Callable[[np.ndarray], np.ndarray]:
    """v_r over scenario time [ns] → [m/s], as the leader says it."""
    changes = leader_brief(scenario).speed_changes
    return np.vectorize(partial(speed_at, changes), otypes=[np.float64])


def leader_profile(scenario: Scenario, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """v_r from 0 to a time as straight lines: their ends [s], and v_r there [m/s]."""
    changes = leader_brief(scenario).speed_changes
    times_ns = np.array(corners(changes, round(end_s * 1e9)), dtype=np.int64)
    return times_ns * 1e-9, leader_speed(scenario)(times_ns)


def _cut_short(record: Record, scenario: Scenario, stats: RunStats) -> dict[str, str]:
    """Robots that were followed up to a time before the end of a completed run, and why."""
    if stats.ended != "completed":
        return {}
    ends_at_s, period_s = scenario.ends_at_s, scenario.clock.control_period_s
    short = {}
    for robot in scenario.names:
        ticks = min(len(record.plant[robot]), len(record.controller[robot]))
        if ticks < round(ends_at_s / period_s):
            why = stats.left_early.get(robot) or "no rows after that"
            short[robot] = f"cut short at {ticks * period_s:g} s of {ends_at_s:g} s: {why}"
    return short


def _nanoseconds(t_s: np.ndarray) -> np.ndarray:
    """Times of the record as the controllers had them."""
    rounded: np.ndarray = np.rint(t_s * 1e9).astype(np.int64)
    return rounded


def _known(s: np.ndarray) -> np.ndarray:
    """The rows that came: of others not even the path variable is known; all, if none did."""
    known: np.ndarray = np.isfinite(s)
    return known if known.any() else ~known


def _robot(
    rows: np.ndarray, v_r: np.ndarray, member: Membership, period_s: float
) -> dict[str, Any]:
    """Of one robot while it is a member of the formation."""
    ticks = min(len(rows), member.leaves_tick)
    rows, v_r = rows[member.ticks], v_r[: len(rows)][member.ticks]
    known = _known(rows["s"])
    rows, v_r = rows[known], v_r[known]
    t, last = rows["t_s"], _final(rows["t_s"])
    torque = max(_peak(rows["tau_right_wheel_N_m"]), _peak(rows["tau_left_wheel_N_m"]))
    return {
        "ticks": ticks,
        "joined_s": _seconds(member.joins_tick * period_s),
        "left_s": _seconds(ticks * period_s) if ticks == member.leaves_tick else None,
        "settle_s": {name: settle_s(t, rows[name]) for name in ERRORS},
        "final_max": {name: _peak(rows[name][last]) for name in ERRORS},
        "final_from_s": _seconds(t[last][0]),
        "peak_torque_wheel_N_m": torque,
        "settle_s_dot_s": settle_s(t, rows["s_dot"] - v_r),
    }


def _peak(values: np.ndarray) -> float:
    return float(np.max(np.abs(values)))


def _worst(robots: list[dict[str, Any]]) -> dict[str, Any] | None:
    if not robots:
        return None
    settles = {name: [robot["settle_s"][name] for robot in robots] for name in ERRORS}
    return {
        "settle_s": {name: None if None in v else max(v) for name, v in settles.items()},
        "final_max": {name: max(robot["final_max"][name] for robot in robots) for name in ERRORS},
        "peak_torque_wheel_N_m": max(robot["peak_torque_wheel_N_m"] for robot in robots),
    }


def _spread_of(
    controllers: Mapping[str, np.ndarray], members: Mapping[str, Membership]
) -> dict[str, float | None] | None:
    values = spread(controllers, members)
    if not len(values):
        return None
    known = _known(values)
    t, values = next(iter(controllers.values()))["t_s"][: len(values)][known], values[known]
    return {
        "peak": float(values.max()),
        "settle_s": settle_s(t, values),
        "final": float(values[_final(t)].max()),
        "final_from_s": _seconds(t[_final(t)][0]),
    }


def _realtime(controllers: dict[str, np.ndarray], stats: RunStats) -> dict[str, Any]:
    """How well the wall clock was kept: counts, and percentiles over all ticks."""
    robots = {
        robot: {
            **counts,
            "miss_percent": round(100.0 * counts["misses"] / len(controllers[robot]), 4),
            "late_us": _percentiles(controllers[robot]["late_s"]),
            "round_trip_us": _percentiles(controllers[robot]["round_trip_s"]),
        }
        for robot, counts in stats.realtime.items()
        if robot in controllers
    }
    total = sum(stats.realtime[robot]["misses"] for robot in robots)
    ticks = sum(len(controllers[robot]) for robot in robots)
    cpu = sum(stats.cpu_s.values()) / stats.wall_s if stats.wall_s > 0 else 0.0
    return {
        "miss_percent": round(100.0 * total / max(1, ticks), 4),
        "late_us": _percentiles(np.concatenate([r["late_s"] for r in controllers.values()])),
        "round_trip_us": _percentiles(
            np.concatenate([r["round_trip_s"] for r in controllers.values()])
        ),
        "cpu_percent_of_one_core": round(100.0 * cpu, 1),
        "missing_privileges": sorted(stats.missing_privileges),
        "robots": robots,
    }


def _profile(stats: RunStats, ticks: int) -> dict[str, dict[str, float]] | None:
    """Processor time per tick by process and part [µs]; None if it wasn't sampled."""
    if not stats.profile_s or not ticks:
        return None
    parts = dict(stats.profile_s)
    parts[RECORDER.name] = {"record": stats.cpu_s.get(RECORDER.name, 0.0)}
    parts[LAUNCHER.name] = {"Zenoh": stats.cpu_s.get(LAUNCHER.name, 0.0)}
    return {
        process: {part: round(seconds / ticks * 1e6, 2) for part, seconds in shares.items()}
        for process, shares in sorted(parts.items())
    }


def _percentiles(seconds: np.ndarray) -> dict[str, float]:
    values = seconds[np.isfinite(seconds)] * 1e6
    if not len(values):
        return {}
    points = np.percentile(values, [50, 99, 99.9, 100])
    return {
        name: round(float(v), 1)
        for name, v in zip(("p50", "p99", "p99.9", "max"), points, strict=True)
    }
