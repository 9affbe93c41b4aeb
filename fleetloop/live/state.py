"""The picture of a run that goes on: fed with rows, events and statuses, gives what is drawn. Pure.

    rows        of plant and controllers, in blocks of consecutive ticks
    status      as the run's door says it: `run.status`, and its faults
    events      of the run, in the order in which they came

Rows wait, undecoded, until `settle`, in bounded memory.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from configs.brief import Schedule
from configs.connections import NetworkLink
from configs.events import MAX_EVENTS, Event, in_order
from configs.resolve import agent_brief, schedule, signals_of
from configs.scenario import Scenario
from configs.signals import PLANT_SIGNALS, Signal
from fleetloop.live.edges import LiveEdge, cut_edges
from fleetloop.live.expected import LiveExpectations, Source
from fleetloop.live.series import History, Track

SAMPLE_S = 0.01
"""A bin of the series, in scenario time, or a tick if that is longer."""
CHARTED = 16
"""Robots with series: those of a larger fleet are in the plane and in the tables."""
MOST_WAITING_BYTES = 1 << 25
"""Of rows before `settle`; what comes then is passed over."""
BEHIND_TICKS = 512
"""A source that is so far behind the farthest one has no rows any more that others wait for."""


class Column(NamedTuple):
    """One signal of a robot as it is drawn."""

    name: str
    source: Source
    signal: str
    series: bool = True
    """It is drawn over time as well."""
    peak: bool = False


COLUMNS = (
    Column("x", "plant", "x_m"),
    Column("y", "plant", "y_m"),
    Column("theta", "plant", "theta_rad", series=False),
    Column("x_d", "controller", "x_d_m", series=False),
    Column("y_d", "controller", "y_d_m", series=False),
    Column("theta_d", "controller", "theta_d_rad", series=False),
    Column("s", "controller", "s"),
    Column("x_e", "controller", "x_e_m", peak=True),
    Column("y_e", "controller", "y_e_m", peak=True),
    Column("theta_e", "controller", "theta_e_rad", peak=True),
    Column("tau_right", "controller", "tau_right_wheel_N_m", peak=True),
    Column("tau_left", "controller", "tau_left_wheel_N_m", peak=True),
    Column("v_r_hat", "controller", "v_r_hat", series=False),
)
SERIES = tuple(column for column in COLUMNS if column.series)
NOW = tuple(column.name for column in COLUMNS)


class _Source:
    """One source of rows: how its columns are found, and what was heard of it."""

    def __init__(self, table: Sequence[Signal], source: Source, stride: int) -> None:
        places = {signal.name: at for at, signal in enumerate(table)}
        own = [column for column in COLUMNS if column.source == source]
        self.width = len(table)
        self.track = Track([places[one.signal] for one in own], [one.peak for one in own], stride)
        self.now = np.array([at for at, one in enumerate(COLUMNS) if one.source == source])
        """Places of its columns in a row of `NOW`."""
        drawn = [at for at, one in enumerate(own) if one.series]
        self.drawn = np.array(drawn, dtype=np.intp)
        self.series = np.array([at for at, one in enumerate(SERIES) if one.source == source])
        self.waiting: list[tuple[int, bytes]] = []


class LiveState:
    """The picture of one run."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.schedule: Schedule = schedule(scenario)
        self.robots = scenario.names
        self.charted = self.robots[:CHARTED]
        period_s = self.schedule.period_s
        self.stride = max(1, round(SAMPLE_S / period_s))
        tables = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
        self._sources: dict[tuple[str, Source], _Source] = {}
        for robot, table in tables.items():
            self._sources[robot, "plant"] = _Source(PLANT_SIGNALS, "plant", self.stride)
            self._sources[robot, "controller"] = _Source(table, "controller", self.stride)
        self.edges = _edges(scenario, tables)
        self.history = History([False, *(one.peak for _ in self.charted for one in SERIES)])
        self._made = 0  # bins that are in the history
        self._bins: dict[tuple[str, Source], list[tuple[int, np.ndarray]]] = {}
        self.expectations = LiveExpectations(scenario, tables)
        self._room = MOST_WAITING_BYTES
        self.passed_over = 0
        """Blocks of rows that found no room."""
        self.status: Mapping[str, Any] = {}
        self.faults: Sequence[Mapping[str, Any]] = ()
        self.events: list[Event] = []
        self.events_known = False
        self.ended = False
        self.verdict = ""
        """The run's own, once its summary is there."""

    # --- feeding ----------------------------------------------------------------------------------

    def hear(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """Take a block of rows as it travels; it waits until `settle`."""
        if len(rows) > self._room:
            self.passed_over += 1
            return
        self._room -= len(rows)
        self._sources[robot, source].waiting.append((first_tick, rows))

    def note_events(self, events: Iterable[Event]) -> None:
        """Take events that follow those that are there."""
        self.events_known = True
        self.events += list(events)[: 8 * MAX_EVENTS - len(self.events)]

    def take_over(self, other: "LiveState") -> None:
        """Know of the run, but for its rows, what another picture of it knows."""
        self.status, self.faults = other.status, other.faults
        self.events, self.events_known = other.events, other.events_known
        self.ended, self.verdict = other.ended, other.verdict

    def settle(self) -> None:
        """Decode what waits, and go on with the series."""
        self.decode()
        self._fill_history()

    def decode(self) -> None:
        """Decode what waits; the series stay as they are."""
        self._room = MOST_WAITING_BYTES
        for (robot, source), held in self._sources.items():
            for first, block in _joined(held.waiting, 8 * held.width):
                rows = np.frombuffer(block, dtype="<f8").reshape(-1, held.width)
                held.track.add(first, rows)
                self.expectations.add(robot, source, first, rows)
                if source == "controller":
                    for edge in self.edges:
                        if edge.edge[1] == robot:
                            edge.add(first + len(rows) - 1, rows)
            held.waiting.clear()

    def judge(self) -> None:
        """Judge the expectations on what was heard; costs with the rows in their windows."""
        events = in_order(self.events, self.robots) if self.events_known else None
        self.expectations.judge(events)

    def conclude(self, summary: Mapping[str, Any]) -> None:
        """The run's own verdict and expectations, from its summary."""
        self.verdict = summary["verdict"]
        self.expectations.judged = summary["expectations"]

    # --- what is drawn ----------------------------------------------------------------------------

    @property
    def tick(self) -> int:
        """The newest tick of which a row was heard, −1 before."""
        return max(held.track.last_tick for held in self._sources.values())

    @property
    def t_s(self) -> float:
        """Its scenario time."""
        return max(self.tick, 0) * self.schedule.period_s

    @property
    def seen_from_s(self) -> float:
        """From this scenario time on there are series."""
        return self.history.begin * self.stride * self.schedule.period_s

    def now(self) -> np.ndarray:
        """The newest value of each of `NOW` (robots, columns); NaN: none yet."""
        values = np.full((len(self.robots), len(COLUMNS)), np.nan)
        for number, robot in enumerate(self.robots):
            for source in ("plant", "controller"):
                held = self._sources[robot, source]
                values[number, held.now] = held.track.last
        return values

    def edge_states(self) -> np.ndarray:
        """Per edge (edges, 3): age [s] or NaN, share lost, state."""
        cut = cut_edges(self.faults, [edge.edge for edge in self.edges])
        said = self.status.get("robots") or {}
        for edge in self.edges:
            speaker, hearer = edge.edge
            age_s = (said.get(hearer) or {}).get("neighbours", {}).get(speaker)
            if isinstance(age_s, float):
                edge.note_age(age_s)
        rows = [(edge.age_s, edge.lost, edge.state(cut)) for edge in self.edges]
        return np.array(rows, dtype=float).reshape(-1, 3)

    # --- series -----------------------------------------------------------------------------------

    def _fill_history(self) -> None:
        """Bins that all sources have, but for those that are far behind, go into the history."""
        tracks = [held.track for held in self._sources.values()]
        farthest = max(track.last_tick for track in tracks)
        alive = [t for t in tracks if t.last_tick > farthest - BEHIND_TICKS]
        end = min(track.bins for track in alive)
        for key, held in self._sources.items():
            self._bins.setdefault(key, []).extend(held.track.ready)
            held.track.ready.clear()
        if end <= self._made:
            return
        if not self._made and farthest >= 0:  # of a page that comes later
            firsts = [blocks[0][0] for blocks in self._bins.values() if blocks]
            self._made = min(firsts, default=end)
        count = end - self._made
        if count <= 0:
            return
        width = len(SERIES)
        rows = np.full((count, 1 + width * len(self.charted)), np.nan)
        rows[:, 0] = (np.arange(self._made, end) + 1) * self.stride - 1
        rows[:, 0] *= self.schedule.period_s
        for number, robot in enumerate(self.charted):
            for source in ("plant", "controller"):
                held = self._sources[robot, source]
                places = 1 + number * width + held.series
                for first, values in self._bins[robot, source]:
                    begin, upto = max(first, self._made), min(first + len(values), end)
                    if begin < upto:
                        part = values[begin - first : upto - first][:, held.drawn]
                        rows[begin - self._made : upto - self._made, places] = part
        for key, blocks in self._bins.items():
            self._bins[key] = [one for one in blocks if one[0] + len(one[1]) > end]
        self.history.append(self._made, rows)
        self._made = end


def _joined(blocks: Sequence[tuple[int, bytes]], row_bytes: int) -> Iterator[tuple[int, bytes]]:
    """Blocks of rows, those of consecutive ticks as one."""
    parts: list[bytes] = []
    first = end = 0
    for begin, block in blocks:
        if parts and begin != end:
            yield first, b"".join(parts)
            parts = []
        if not parts:
            first = end = begin
        parts.append(block)
        end += len(block) // row_bytes
    if parts:
        yield first, b"".join(parts)


def _edges(scenario: Scenario, tables: Mapping[str, Sequence[Signal]]) -> list[LiveEdge]:
    """The edges between robots, in the order of their hearers."""
    nowhere = NetworkLink("live", "", "", "")
    clock = scenario.clock
    return [
        LiveEdge(
            edge,
            robot,
            tables[robot],
            share_period_s=clock.share_period_s,
            period_s=clock.control_period_s,
        )
        for robot in scenario.names
        for edge in agent_brief(scenario, robot, network=nowhere, bus=()).hears
    ]
