"""Derived signals: what is made of the record of several signals or robots."""

from collections.abc import Callable, Mapping

import numpy as np

from agents.paths import robot_path
from configs.curves import formation_offset, reference_path
from configs.membership import Membership
from configs.scenario import Scenario

_PATH_POINTS = 4096
"""The path of a run as a polygon; of a path of 40 m and radii of 1 m it is off by 12 µm."""
_MARGIN_M = 1.0
"""The path goes on so far before the first and behind the last s of the record."""
_BLOCK = 256
"""Ticks that are compared with all points at once."""


def mask(member: Membership, ticks: int) -> np.ndarray:
    """By tick, whether a robot is a member."""
    there = np.zeros(ticks, dtype=bool)
    there[member.ticks] = True
    return there


def counted(rows: np.ndarray, member: Membership) -> np.ndarray:
    """Rows of a controller at which its robot is a member; not those until it has re-joined."""
    there: np.ndarray = ~np.isnan(rows["s"])
    there[: member.joins_tick] = False
    there[member.leaves_tick :] = False
    return there


def spread(controllers: Mapping[str, np.ndarray], members: Mapping[str, Membership]) -> np.ndarray:
    """max_i s_i − min_i s_i over the members at every tick at which all robots have a row."""
    ticks = min(len(rows) for rows in controllers.values())
    there = [counted(rows, members[robot])[:ticks] for robot, rows in controllers.items()]
    s = [rows["s"][:ticks] for rows in controllers.values()]
    return spread_of(np.stack(s, axis=1), np.stack(there, axis=1))


def spread_of(s: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Max − min of each row over those that are there, 0 without any."""
    most = np.where(there, s, -np.inf).max(axis=1)
    least = np.where(there, s, np.inf).min(axis=1)
    difference: np.ndarray = np.where(there.any(axis=1), most - least, 0.0)
    return difference


def distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Between two robots [m], of their rows of the plant, as far as both go."""
    ticks = min(len(one), len(other))
    one, other = one[:ticks], other[:ticks]
    apart: np.ndarray = np.hypot(one["x_m"] - other["x_m"], one["y_m"] - other["y_m"])
    return apart


def path_distance(scenario: Scenario, robot: str, plant: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Of a robot from its own path [m], of its rows of the plant and the s of its controller.

    The path is where its reference point is for all s that it had, and `_MARGIN_M` beyond.
    """
    known = s[np.isfinite(s)]
    if not len(plant) or not len(known):
        return np.full(len(plant), np.nan)
    (own,) = (one for one in scenario.robot if one.name == robot)
    path = robot_path(reference_path(scenario.path), formation_offset(own.offset))
    places = np.linspace(known.min() - _MARGIN_M, known.max() + _MARGIN_M, _PATH_POINTS)

    def point(s: float) -> tuple[float, float]:
        here = path(s)
        return here.x, here.y

    points = _points(point, places)
    if len(points) < 2:
        return np.full(len(plant), np.nan)
    return polygon_distance(np.stack([plant["x_m"], plant["y_m"]], axis=1), points)


def _points(path: Callable[[float], tuple[float, ...]], places: np.ndarray) -> np.ndarray:
    """Points of a path; not those at which a path of the user's own fails."""
    points = []
    for s in places:
        try:
            points.append(path(float(s)))
        except Exception:  # beyond the end that it has
            continue
    return np.array(points, dtype=float)


def polygon_distance(places: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance of each place (n, 2) from an open polygon with these corners (m, 2), m ≥ 2.

    From the two sides at the nearest corner; exact where the sides are shorter than the polygon's
    distance from itself.
    """
    nearest = np.full(len(places), np.nan)
    square = (corners**2).sum(axis=1)
    for start in range(0, len(places), _BLOCK):
        block = places[start : start + _BLOCK]
        # |p − c|² without |p|², which is the same for all corners.
        corner = np.argmin(square - 2.0 * (block @ corners.T), axis=1)
        before = _side_distance(block, corners, np.maximum(corner - 1, 0))
        behind = _side_distance(block, corners, np.minimum(corner, len(corners) - 2))
        nearest[start : start + _BLOCK] = np.minimum(before, behind)
    return nearest


def _side_distance(places: np.ndarray, corners: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Distance of each place from the side that begins at the corner of its number."""
    begin, along = corners[side], corners[side + 1] - corners[side]
    square = (along**2).sum(axis=1)
    to_place = places - begin
    share = np.divide(
        (to_place * along).sum(axis=1), square, out=np.zeros(len(places)), where=square > 0.0
    )
    foot = begin + np.clip(share, 0.0, 1.0)[:, None] * along
    apart: np.ndarray = np.hypot(*(places - foot).T)
    return apart
