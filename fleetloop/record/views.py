"""Channels of the whole fleet, made of the rows of all robots: scenes, frames, differences of s.

Of each block of ticks those that begin a new period of the views are chosen, by their number, so
that the messages don't depend on how rows are cut into blocks. A robot is drawn where its plant
says, without one where its controller takes it to be; without either it isn't drawn.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agents.paths import robot_path
from configs.brief import Drawing, DrawnRobot
from configs.edges import Windows
from configs.signals import AGE_PREFIX, PLANT_SIGNALS, USED_SIGNALS
from fleetloop.record import scene
from fleetloop.record.cdr import Template
from fleetloop.record.messages import fleet_messages, framed
from fleetloop.record.schema import Layout, View

VIEW_PERIOD_NS = 50_000_000
_PATH_POINTS = 500


def _columns(table: Sequence[NamedTuple], *names: str) -> list[int]:
    found = [signal[0] for signal in table]
    return [found.index(name) for name in names]


_TRUE_POSE = _columns(PLANT_SIGNALS, "x_m", "y_m", "theta_rad")
_USED_POSE = _columns(USED_SIGNALS, "x_used_m", "y_used_m", "theta_used_rad")
_REFERENCE = _columns(USED_SIGNALS, "x_d_m", "y_d_m", "theta_d_rad")
_S = _columns(USED_SIGNALS, "s")


class _Edge(NamedTuple):
    """An edge by the numbers of its robots."""

    speaker: int
    hearer: int
    windows: Windows | None
    age: int | None
    """The column of the age of what is heard; None: ages don't vary."""


class _Taken(NamedTuple):
    """What is drawn of some instants, but for the first one by robot or edge and instant."""

    ticks: np.ndarray
    poses: np.ndarray
    references: np.ndarray
    s: np.ndarray
    ages: np.ndarray


class Views:
    """Makes the messages of a record's views from consecutive blocks of rows.

    Args:
        layout: of the record.
        drawing: what is known of the scenario.
        period_ns: of the rows.
        lifetime_ns: after this time scenes vanish; None: two periods of the views.
    """

    def __init__(
        self, layout: Layout, drawing: Drawing, period_ns: int, lifetime_ns: int | None = None
    ) -> None:
        self._names = layout.robots
        self._robots = drawing.robots or (DrawnRobot(),) * len(layout.robots)
        self._colours = [scene.colour_of(robot.colour) for robot in self._robots]
        self._half_track_m = np.array([robot.wheels.half_track_m for robot in self._robots])
        self._silence_s = drawing.silence_s
        self._period_ns = period_ns
        self._every = max(1, VIEW_PERIOD_NS // period_ns)
        if lifetime_ns is None:
            lifetime_ns = scene.LIFETIME_PERIODS * self._every * period_ns
        self._lifetime_ns = lifetime_ns
        self._templates: dict[tuple[View, tuple[int, ...]], Template] = {}
        self._edges = [_edge(layout, *named) for named in drawing.edges]
        self._taken: list[_Taken] = []

    def take(
        self, first_tick: int, plant: Sequence[np.ndarray], controller: Sequence[np.ndarray]
    ) -> None:
        """Take the rows of consecutive ticks.

        Args:
            first_tick: of the rows.
            plant: rows of each robot, float64; a robot may have fewer than others, or none.
            controller: likewise.
        """
        count = max(map(len, (*plant, *controller)))
        index = np.arange(-first_tick % self._every, count, self._every)
        if not len(index):
            return
        poses = _picked(plant, index, _TRUE_POSE)
        used = _picked(controller, index, _USED_POSE + _REFERENCE + _S)
        poses = np.where(_known(poses)[..., None], poses, used[..., :3])
        s = used[..., 6]
        ages = np.empty((len(self._edges), len(index)))
        for number, edge in enumerate(self._edges):
            ages[number] = _age(edge, index, s, controller)
        self._taken.append(_Taken(first_tick + index, poses, used[..., 3:6], s, ages))

    @property
    def taken(self) -> int:
        """How many instants were taken of which there are no messages yet."""
        return sum(len(one.ticks) for one in self._taken)

    def messages(self) -> Iterator[tuple[View, list[np.ndarray]]]:
        """The messages of what was taken since the last time, by view, but for views without one.

        Those of a view come in parts, each of messages of equal length.
        """
        if not self._taken:
            return
        ticks, poses, references, s, ages = (
            np.concatenate(parts, axis=axis)
            for parts, axis in zip(zip(*self._taken, strict=True), (0, 1, 1, 1, 1), strict=True)
        )
        self._taken.clear()
        if ticks[0] == 0 and (paths := self.paths()):
            yield View.PATHS, paths
        there = _known(poses)
        yield from self._view(
            View.ROBOTS,
            ticks,
            there,
            lambda some, at: scene.robots_numbers(poses[some, at], self._half_track_m[some]),
        )
        yield from self._view(
            View.REFERENCES,
            ticks,
            _known(references),
            lambda some, at: scene.references_numbers(references[some, at]),
        )
        if self._edges:
            yield from self._drawn_edges(ticks, poses, ages)
        yield from self._view(
            View.TRANSFORMS,
            ticks,
            there,
            lambda some, at: scene.transforms_numbers(poses[some, at]),
        )
        yield View.FLEET, [self._fleet(ticks, s)]

    def _drawn_edges(
        self, ticks: np.ndarray, poses: np.ndarray, ages: np.ndarray
    ) -> Iterator[tuple[View, list[np.ndarray]]]:
        begins = poses[[edge.speaker for edge in self._edges], :, :2]
        ends = poses[[edge.hearer for edge in self._edges], :, :2]
        exists = np.stack([_exists(edge.windows, ticks) for edge in self._edges])
        shares = ages / self._silence_s
        shares[~exists | (shares > 1.0)] = np.nan
        yield from self._view(
            View.EDGES,
            ticks,
            np.isfinite(begins).all(axis=-1) & np.isfinite(ends).all(axis=-1),
            lambda some, at: scene.edges_numbers(
                begins[some, at], ends[some, at], exists[some, at], shares[some, at]
            ),
        )

    def _view(
        self,
        view: View,
        ticks: np.ndarray,
        there: np.ndarray,
        numbers: Callable[[list[int], slice], np.ndarray],
    ) -> Iterator[tuple[View, list[np.ndarray]]]:
        """Messages of a view, in parts between which other entities are there."""
        parts = []
        for at in _parts(there):
            some = np.flatnonzero(there[:, at.start]).tolist()
            if some:
                times_ns = ticks[at] * self._period_ns
                template = self._template(view, tuple(some))
                bodies = template.filled(times_ns, numbers(some, at))
                parts.append(framed(view, ticks[at], times_ns, bodies))
        if parts:
            yield view, parts

    def _template(self, view: View, some: tuple[int, ...]) -> Template:
        """The template of a view with these entities."""
        found = self._templates.get((view, some))
        if found is None:
            found = self._templates[view, some] = self._laid(view, some)
        return found

    def _laid(self, view: View, some: tuple[int, ...]) -> Template:
        names, colours = self._names, self._colours
        match view:
            case View.ROBOTS:
                drawn = [(names[n], colours[n], self._robots[n].wheels) for n in some]
                return scene.robots_template(drawn, self._lifetime_ns)
            case View.REFERENCES:
                wanted = [(names[n], colours[n]) for n in some]
                return scene.references_template(wanted, self._lifetime_ns)
            case View.EDGES:
                edges = [self._edges[n] for n in some]
                pairs = [(names[edge.speaker], names[edge.hearer]) for edge in edges]
                return scene.edges_template(pairs, self._lifetime_ns)
            case _:
                return scene.transforms_template([names[n] for n in some])

    def paths(self) -> list[np.ndarray]:
        """The message of the paths, of tick 0; none if no path is known."""
        paths = []
        for name, colour, robot in zip(self._names, self._colours, self._robots, strict=True):
            points = path_points(robot)
            if len(points) > 1:
                paths.append((name, colour, points))
        if not paths:
            return []
        start = np.zeros(1, np.int64)
        bodies = scene.paths_template(paths).filled(start, np.empty((1, 0)))
        return [framed(View.PATHS, start, start, bodies)]

    def _fleet(self, ticks: np.ndarray, s: np.ndarray) -> np.ndarray:
        known = np.isfinite(s)
        some = known.any(axis=0)
        most = np.where(known, s, -np.inf).max(axis=0)
        least = np.where(known, s, np.inf).min(axis=0)
        mean = np.where(known, s, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        spread = np.subtract(most, least, out=np.zeros(len(ticks)), where=some)
        return fleet_messages(ticks, spread, np.where(known, s - mean, np.nan).T, self._period_ns)


def path_points(robot: DrawnRobot) -> np.ndarray:
    """Points (n, 2) of a robot's path [m]; not those at which a path of the user's own fails."""
    if robot.path is None:
        return np.empty((0, 2))
    path = robot_path(*robot.path)
    points = []
    for s in np.linspace(*robot.s_span, _PATH_POINTS).tolist():
        try:
            here = path(s)
        except Exception:  # beyond the end that it has
            continue
        points.append((here.x, here.y))
    return np.array(points).reshape(-1, 2)


def _edge(layout: Layout, speaker: str, hearer: str, windows: Windows | None) -> _Edge:
    numbers = {robot: number for number, robot in enumerate(layout.robots)}
    names = [signal.name for signal in layout.controllers[numbers[hearer]]]
    age = f"{AGE_PREFIX}{speaker}_s"
    return _Edge(
        numbers[speaker], numbers[hearer], windows, names.index(age) if age in names else None
    )


def _exists(windows: Windows | None, ticks: np.ndarray) -> np.ndarray:
    """Whether an edge exists, at each tick."""
    if windows is None:
        return np.ones(len(ticks), bool)
    begins, ends = np.array(windows, np.int64).reshape(-1, 2).T
    begun = np.searchsorted(begins, ticks, side="right")
    there: np.ndarray = (begun > 0) & (ticks < np.append(-1, ends)[begun])
    return there


def _age(
    edge: _Edge, index: np.ndarray, s: np.ndarray, controller: Sequence[np.ndarray]
) -> np.ndarray:
    """Ages of what is heard [s], NaN: nothing is."""
    if edge.age is None:
        return np.where(np.isfinite(s[edge.hearer]), 0.0, np.nan)
    (ages,) = _picked([controller[edge.hearer]], index, [edge.age])
    not_ahead: np.ndarray = np.maximum(ages[:, 0], 0.0)  # of a clock that is behind
    return not_ahead


def _picked(tables: Sequence[np.ndarray], index: np.ndarray, columns: list[int]) -> np.ndarray:
    """These rows and columns of each table, NaN for rows that aren't there."""
    picked = np.full((len(tables), len(index), len(columns)), np.nan)
    for number, rows in enumerate(tables):
        count = int(np.searchsorted(index, len(rows)))
        if count:
            picked[number, :count] = rows[index[:count, None], columns]
    return picked


def _known(poses: np.ndarray) -> np.ndarray:
    known: np.ndarray = np.isfinite(poses).all(axis=-1)
    return known


def _parts(there: np.ndarray) -> list[slice]:
    """The times cut where other entities are there."""
    changes = np.flatnonzero((there[:, 1:] != there[:, :-1]).any(axis=0)) + 1
    borders = [0, *changes.tolist(), there.shape[1]]
    return [slice(begin, end) for begin, end in pairwise(borders)]
