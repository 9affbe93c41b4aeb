"""Numbers and courses of one run, for a table and a figure with those of other laws.

rms      root mean square over ticks and robots
final    the last `FINAL_S` of a run, as everywhere
worst    the robot with the greatest magnitude at a tick
Θ̂ error  ‖Θ̂ − Θ‖ / ‖Θ‖ with the robot's true Θ of (32), of a law that records Θ̂
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from configs.membership import ALWAYS, Membership
from configs.scenario import Scenario
from fleetloop.check.body import robot_body
from fleetloop.check.loop import true_theta
from fleetloop.record.reader import Record
from fleetloop.results.decimation import decimated
from fleetloop.results.derived import spread
from fleetloop.results.summary import ERRORS, Summary
from fleetloop.settling import FINAL_S

TORQUES = ("tau_right_wheel_N_m", "tau_left_wheel_N_m")
SPREAD, TORQUE, THETA_ERROR = "s_spread", "torque_wheel_N_m", "theta_hat_error"
_THETA_HAT = tuple(f"theta_hat_{n}" for n in range(1, 9))

Measures = dict[str, Any]
"""Numbers of one run as compare.json has them; None where there is none."""


@dataclass(frozen=True, slots=True)
class Course:
    """A quantity over time, thinned to what a figure shows, with every peak."""

    t_s: np.ndarray
    values: np.ndarray


def measures(record: Record, scenario: Scenario, summary: Summary) -> Measures:
    """Numbers of a run; at least one robot has a tick in its record."""
    moving = _moving(record).items()
    there = {robot: rows[scenario.members[robot].ticks] for robot, rows in moving}
    robots = {robot: rows for robot, rows in there.items() if len(rows)}
    last = {robot: rows[_final(rows)] for robot, rows in robots.items()}
    worst = summary["worst"] or next(iter(summary["robots"].values()))
    along = summary["s_spread"] or {}
    with np.errstate(all="ignore"):
        return {
            "settle_s": {**worst["settle_s"], SPREAD: along.get("settle_s")},
            "final_max": {**worst["final_max"], SPREAD: along.get("final")},
            "spread_peak_m": along.get("peak"),
            "rms": {name: _rms([rows[name] for rows in robots.values()]) for name in ERRORS},
            "final_rms": {name: _rms([rows[name] for rows in last.values()]) for name in ERRORS},
            "position_rms_m": _position_rms(robots),
            "final_position_rms_m": _position_rms(last),
            "torque_wheel_N_m": {
                "peak": worst["peak_torque_wheel_N_m"],
                "rms": _rms(_torques(robots)),
                "final_rms": _rms(_torques(last)),
                "final_change_rms": _rms([np.diff(torque) for torque in _torques(last)]),
            },
            "theta_hat_error": _learnt(robots, scenario),
        }


def courses(record: Record, scenario: Scenario) -> dict[str, Course]:
    """Worst magnitudes over time: errors, spread, torque, and error of Θ̂ where it is recorded."""
    moving = _moving(record)
    robots = {robot: _as_member(rows, scenario.members[robot]) for robot, rows in moving.items()}
    t = max((rows["t_s"] for rows in robots.values()), key=len)
    with np.errstate(all="ignore"):
        found = {name: _worst([rows[name] for rows in robots.values()]) for name in ERRORS}
        found[TORQUE] = _worst(_torques(robots))
        if len(robots) > 1:
            found[SPREAD] = spread(moving, scenario.members)
        if theta := _theta_errors(robots, scenario):
            found[THETA_ERROR] = _worst(theta)
        return {name: Course(*decimated(t[: len(v)], v)) for name, v in found.items()}


def _moving(record: Record) -> dict[str, np.ndarray]:
    return {robot: rows for robot, rows in record.controller.items() if len(rows)}


def _as_member(rows: np.ndarray, member: Membership) -> np.ndarray:
    """The rows with 0 for what a robot doesn't have while it isn't part of the formation."""
    if member == ALWAYS:
        return rows
    there = np.zeros(len(rows), dtype=bool)
    there[member.ticks] = True
    found = rows.copy()
    for name in set(rows.dtype.names or ()).difference(("tick", "t_s")):
        found[name] = np.where(there, rows[name], 0)
    return found


def _final(rows: np.ndarray) -> slice:
    t = rows["t_s"]
    return slice(int(np.searchsorted(t, t[-1] - FINAL_S, side="right")), None)


def _torques(robots: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    return [rows[wheel] for rows in robots.values() for wheel in TORQUES]


def _rms(series: Sequence[np.ndarray]) -> float | None:
    values = np.concatenate(series)
    return float(np.sqrt(np.mean(values * values))) if len(values) else None


def _position_rms(robots: Mapping[str, np.ndarray]) -> float | None:
    return _rms([np.hypot(rows["x_e_m"], rows["y_e_m"]) for rows in robots.values()])


def _worst(series: Sequence[np.ndarray]) -> np.ndarray:
    """The greatest magnitude at every tick at which all have a value."""
    ticks = min(map(len, series))
    values: np.ndarray = np.max(np.abs(np.stack([one[:ticks] for one in series])), axis=0)
    return values


def _theta_errors(robots: Mapping[str, np.ndarray], scenario: Scenario) -> list[np.ndarray]:
    """‖Θ̂ − Θ‖ / ‖Θ‖ of each robot whose law records Θ̂."""
    errors = []
    for robot in scenario.robot:
        rows = robots.get(robot.name)
        if rows is None or not set(_THETA_HAT) <= set(rows.dtype.names or ()):
            continue
        theta = np.array(true_theta(robot_body(scenario.body_of(robot))))
        estimates = np.stack([rows[name] for name in _THETA_HAT], axis=1)
        errors.append(np.linalg.norm(estimates - theta, axis=1) / np.linalg.norm(theta))
    return errors


def _learnt(robots: Mapping[str, np.ndarray], scenario: Scenario) -> dict[str, float] | None:
    """The worst error of Θ̂ at the first and at the last tick."""
    errors = _theta_errors(robots, scenario)
    if not errors:
        return None
    return {
        "start": float(max(one[0] for one in errors)),
        "end": float(max(one[-1] for one in errors)),
    }
