"""What travels to a browser several times a second: one array of float64, and what it means. Pure.

    head      FRAME, TICK, T_S, WHOLE, ROWS           whole: the rows replace what the browser has
    now       robots × columns of `state.NOW`
    edges     edges × (age [s], share lost, state)
    series    rows × (t [s], then of each charted robot the columns of `state.SERIES`)

One array is one message with one buffer, whatever the number of robots and signals.
"""

from typing import Any

import numpy as np

from fleetloop.live.series import CAPACITY, History
from fleetloop.live.state import NOW, SERIES, LiveState

HEAD = ("frame", "tick", "t_s", "whole", "rows")


def legend(state: LiveState) -> dict[str, Any]:
    """The meaning of the arrays, for the browser."""
    return {
        "head": list(HEAD),
        "robots": list(state.robots),
        "charted": list(state.charted),
        "now": list(NOW),
        "series": [column.name for column in SERIES],
        "edges": [list(edge.edge) for edge in state.edges],
    }


class Cursor:
    """How far one browser is."""

    __slots__ = ("_history", "_number", "_sent", "frames")

    def __init__(self) -> None:
        self.frames = 0
        self._number = self._sent = 0
        self._history: History | None = None

    def frame(self, state: LiveState) -> np.ndarray:
        """The next frame: what is new since the last.

        It is all of it if the browser's part gets large, or the history is another one.
        """
        rows = state.history.since(self._number)
        whole = state.history is not self._history or self._sent + len(rows) > 2 * CAPACITY
        if whole:
            self._history = state.history
            rows, self._sent = state.history.since(0), 0
        self._sent += len(rows)
        self._number = state.history.end
        self.frames += 1
        head = [self.frames, state.tick, state.t_s, float(whole), len(rows)]
        now, edges = state.now(), state.edge_states()
        return np.concatenate([head, now.ravel(), edges.ravel(), rows.ravel()])
