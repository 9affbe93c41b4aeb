"""What a page shows of a run: which robots by a line of their own, what of all of them together."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from configs.scenario import Scenario
from fleetloop.record.reader import Record
from fleetloop.results.decimation import POINTS, Points, decimated, drawable
from fleetloop.results.marks import Marks, marks_of, state_of
from fleetloop.results.palette import robot_style
from fleetloop.results.panel import Band, Bound, Line, LineStyle, Panel, Spot
from fleetloop.results.summary import ERRORS, Summary
from fleetloop.results.tables import marked_claim
from fleetloop.results.traffic import Traffic

MOST_LINES = 12
"""More robots, and a band is drawn of all and lines of a few."""
FEW = 6
_PANEL_POINTS = 9000
"""Of all lines of a panel together; of a line at most `decimation.POINTS`."""
_STRETCHES = 400
"""Of a band."""
_BAND_COLOUR = "#7d7d7d"


@dataclass(frozen=True, slots=True)
class View:
    """A run as it is drawn."""

    record: Record
    scenario: Scenario
    summary: Summary
    traffic: Sequence[Traffic] = ()
    """Of the buses that were recorded."""
    robots: tuple[str, ...] = field(init=False)
    """Those with lines of their own."""
    end_s: float = field(init=False)
    marks: Marks = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "robots", _chosen(self.record, self.summary))
        ends = [float(rows["t_s"][-1]) for rows in self._rows() if len(rows)]
        object.__setattr__(self, "end_s", max(ends, default=0.0))
        object.__setattr__(self, "marks", marks_of(self.summary, self.scenario, self.end_s))

    @property
    def few(self) -> bool:
        """Whether every robot has lines of its own."""
        return len(self.robots) == len(self.record.robots)

    def style(self, robot: str) -> LineStyle:
        """Of a robot's lines; the same in all panels."""
        chosen = self.robots.index(robot) if robot in self.robots else 0
        style = robot_style(chosen)
        return LineStyle(style.colour, style.dash)

    def points(self, lines: int) -> int:
        """Of each of so many lines of a panel."""
        return max(200, min(POINTS, _PANEL_POINTS // max(1, lines)))

    def panel(self, name: str, title: str, unit: str, *, points: int | None = None) -> Panel:
        """A signal of the controllers: a line per robot, bounds of expectations on it."""
        panel = Panel(title, unit)
        most = points or self.points(len(self.robots))
        for robot in self.robots:
            rows = self.record.controller[robot]
            if len(rows) and name in (rows.dtype.names or ()):
                shown = decimated(rows["t_s"], rows[name], most)
                panel.lines.append(Line(robot, (group_of(robot),), self.style(robot), shown))
        if not self.few:
            series = {
                robot: rows[name]
                for robot, rows in self.record.controller.items()
                if name in (rows.dtype.names or ())
            }
            panel.bands += self.band(series)
        self.expect(panel, name)
        return panel

    def band(self, series: Mapping[str, np.ndarray]) -> list[Band]:
        """From the least to the greatest of all, as a list of one or none."""
        longest = max(self._rows(), key=len)
        found = banded(series.values(), longest["t_s"], _STRETCHES)
        return [Band(f"all {len(series)}", _BAND_COLOUR, *found)] if len(found[0]) else []

    def expect(self, panel: Panel, name: str, robot: str | None = None) -> None:
        """Add what is expected of a signal to its panel; of one robot, if the panel is its own."""
        for one in self.summary["expectations"]:
            window = one.get("window")
            if one.get("signal") != name or not window:
                continue
            if robot is not None and robot not in (one.get("robots") or (robot,)):
                continue
            state, text = state_of(one), marked_claim(one)
            from_s, to_s = window["from_s"], min(window["to_s"], self.end_s)
            from_s += one.get("settle_within_s") or 0.0
            levels = [one.get("min"), one.get("max")]
            if (widest := one.get("max_abs")) is not None:
                levels += [-widest, widest]
            panel.bounds += [
                Bound(level, from_s, to_s, state, text) for level in levels if level is not None
            ]
            worst, value = one["worst"], one["value"]
            in_panel = one.get("settle_within_s") is None
            if worst and robot is not None and robot not in worst["robots"]:
                continue
            if in_panel and worst and worst["t_s"] is not None and _finite(value):
                panel.spots.append(Spot(worst["t_s"], value, state, text))

    def _rows(self) -> Iterable[np.ndarray]:
        return self.record.controller.values()


def group_of(robot: str) -> str:
    """The group of a robot's lines."""
    return f"robot:{robot}"


def line(
    label: str, groups: tuple[str, ...], style: LineStyle, t: np.ndarray, values: np.ndarray
) -> Line:
    """A line of a few points."""
    return Line(label, groups, style, decimated(t, values))


def banded(
    series: Iterable[np.ndarray], t: np.ndarray, stretches: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(t, least, greatest) of all series in each stretch of the run in which any is known."""
    table = [drawable(values) for values in series]
    step = max(1, -(-len(t) // stretches))
    starts = np.arange(0, len(t), step)
    low, high = np.full(len(starts), np.inf), np.full(len(starts), -np.inf)
    for values in table:
        own = starts[starts < len(values)]
        if not len(own):
            continue
        known = np.isfinite(values)
        n = len(own)
        least = np.minimum.reduceat(np.where(known, values, np.inf), own)
        most = np.maximum.reduceat(np.where(known, values, -np.inf), own)
        low[:n], high[:n] = np.minimum(low[:n], least), np.maximum(high[:n], most)
    there = np.isfinite(low) & np.isfinite(high)
    return t[starts][there], low[there], high[there]


def widest(t: np.ndarray, series: Sequence[np.ndarray]) -> Points:
    """The greatest magnitude of all series at each instant."""
    ticks = max(map(len, series), default=0)
    most = np.zeros(ticks)
    for values in series:
        part = most[: len(values)]
        np.fmax(part, np.abs(drawable(values)), out=part)
    return decimated(t[:ticks], most)


def _chosen(record: Record, summary: Summary) -> tuple[str, ...]:
    """All robots, or of many those that are to be looked at first."""
    if len(record.robots) <= MOST_LINES:
        return record.robots
    expected = sorted(summary["expectations"], key=lambda one: one["held"] is not False)
    wanted = [*summary["stopped_robots"], *summary["cut_short"]]
    wanted += [robot for one in expected if one["worst"] for robot in one["worst"]["robots"]]
    wanted += sorted(summary["robots"], key=lambda robot: -_final(summary, robot))
    known = [robot for robot in dict.fromkeys(wanted) if robot in record.robots]
    chosen = set((*known, *record.robots)[:FEW]) if len(known) < FEW else set(known[:FEW])
    return tuple(robot for robot in record.robots if robot in chosen)


def _final(summary: Summary, robot: str) -> float:
    finals = [summary["robots"][robot]["final_max"][name] for name in ERRORS]
    return max((value for value in finals if _finite(value)), default=0.0)


def _finite(value: float | None) -> bool:
    return value is not None and isfinite(value)
