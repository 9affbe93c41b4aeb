"""The page of one viewer: a Bokeh document, its frames and its orders.

Server to browser   `feed`, an array a frame; `board`, JSON: status, expectations, new events
browser to server   `heard`, the number of the last frame that was drawn, 0: it is ready for the
                    first; `orders`, JSON

A browser that has not drawn `MOST_UNDRAWN` frames gets none until it has: it is skipped, and then
gets what it missed in one frame. Frame and board are changes in callbacks of their own: of several
in one, Bokeh drops the rest with a warning if the first is cancelled, as at the end. Whatever a
user named reaches the page as JSON and as text nodes.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.core.templates import get_env
from bokeh.document import Document
from bokeh.models import ColumnDataSource

from configs.scenario import Scenario
from fleetloop.live.course import courses, torque_limits_wheel_N_m
from fleetloop.live.frame import Cursor, legend
from fleetloop.live.plots import charts, plane, styles
from fleetloop.live.state import LiveState
from fleetloop.results.palette import plot_theme, theme_css

FRAME_MS = 45
MOST_UNDRAWN = 9
BOARD_EVERY = 5
"""Frames."""
_HERE = Path(__file__).parent
_SCRIPTS = ("draw.js", "panels.js", "controls.js")


class Page:
    """The document of one viewer.

    Args:
        document: an empty one.
        state: what is drawn, of a run that stays the same.
        about: what the script is told once: names of scenario and run, kinds of faults.
    """

    def __init__(self, document: Document, state: LiveState, about: dict[str, Any]) -> None:
        self._document = document
        self._cursor = Cursor()
        self._events = 0
        self._drawn: int | None = None
        self._ends = False
        self._last: int | None = None  # number of the last frame, once it is sent
        self._board = ""
        self.skipped = 0
        """Frames that were not sent since the browser had too many before it."""
        self.on_order: Callable[[object], None] = lambda _: None
        self._feed = ColumnDataSource(name="feed", data={"frame": np.empty(0)})
        self._board_source = ColumnDataSource(name="board", data={"json": [""]})
        self._heard = ColumnDataSource(name="heard", data={"frame": [-1]})
        self._orders = ColumnDataSource(name="orders", data={"json": [""]})
        self._heard.on_change("data", lambda _, __, data: self._note_drawn(data))
        self._orders.on_change("data", lambda _, __, data: self.on_order(_only(data, "json")))
        with document.models.freeze():  # each root would be looked through for all others
            _build(document, state, about)
            for model in (self._feed, self._board_source, self._heard, self._orders):
                document.add_root(model)

    def push(self, state: LiveState, board: Callable[[int], dict[str, Any]]) -> None:
        """Send the next frame, unless the browser is behind.

        Args:
            state: what is drawn.
            board: the board with the events from this number on; called when one is due.
        """
        if self._drawn is None:
            return
        if self._cursor.frames - self._drawn >= MOST_UNDRAWN:
            self.skipped += 1
            return
        self._feed.data = {"frame": self._cursor.frame(state)}
        if self._cursor.frames % BOARD_EVERY == 1:
            self._document.add_next_tick_callback(lambda: self.push_board(board(self._events)))

    @property
    def has_last(self) -> bool:
        """Whether the browser has drawn the last frame."""
        return self._last is not None and (self._drawn or 0) >= self._last

    def push_last(self, state: LiveState, board: Callable[[int], dict[str, Any]]) -> None:
        """Send the last frame and board once, however far behind the browser is."""
        if self._drawn is not None and not self._ends:
            self._ends = True
            self.push_board(board(self._events))
            self._document.add_next_tick_callback(lambda: self._push_last_frame(state))

    def _push_last_frame(self, state: LiveState) -> None:
        self._feed.data = {"frame": self._cursor.frame(state)}
        self._last = self._cursor.frames

    def push_board(self, board: dict[str, Any]) -> None:
        """Send a board, unless the browser has it."""
        text = json.dumps(board)
        if text != self._board:
            self._board = text
            self._events = board["events"]["next"]
            self._board_source.data = {"json": [text]}

    def _note_drawn(self, data: object) -> None:
        number = _only(data, "frame")
        if isinstance(number, int | float) and 0 <= number <= self._cursor.frames:
            self._drawn = max(int(number), self._drawn or 0)


def _only(data: object, column: str) -> object:
    """The only value of a column that a browser has sent, None if it is anything else."""
    values = data.get(column) if isinstance(data, dict) else None
    return values[0] if isinstance(values, list | tuple) and len(values) == 1 else None


def _build(document: Document, state: LiveState, about: dict[str, Any]) -> None:
    scenario = state.scenario
    document.theme = plot_theme()
    document.title = f"{scenario.name} · fleetloop live"
    document.config.reconnect_session = False
    document.config.notify_connection_status = False
    document.add_root(plane(state.robots, courses(scenario)))
    for chart in charts(scenario, state.charted).values():
        document.add_root(chart)
    facts = about | _facts(scenario, state)
    document.template = get_env().from_string((_HERE / "page.html").read_text("utf-8"))
    document.template_variables.update(
        css=theme_css() + (_HERE / "page.css").read_text("utf-8"),
        script="".join((_HERE / name).read_text("utf-8") for name in _SCRIPTS),
        facts=json.dumps(facts).replace("<", "\\u003c"),
    )


def _facts(scenario: Scenario, state: LiveState) -> dict[str, Any]:
    """What stays as it is in a run."""
    return {
        "scenario": scenario.name,
        "ends_at_s": scenario.ends_at_s,
        "period_s": state.schedule.period_s,
        "realtime": state.schedule.realtime,
        "frame_ms": FRAME_MS,
        "legend": legend(state),
        "styles": [look._asdict() for look in styles(len(state.robots))],
        "starts": [[robot.pose.x_m, robot.pose.y_m] for robot in scenario.robot],
        "lengths_m": [2.4 * scenario.body_of(one).half_track_m for one in scenario.robot],
        "torque_limits": torque_limits_wheel_N_m(scenario),
        "buses": {robot: scenario.bus_of(robot) for robot in state.robots},
    }
