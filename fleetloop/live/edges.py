"""The edges of the communication graph as they are now: age of what came, losses, dead ones. Pure.

age     of what was sent last of all that arrived [s], as the hearer records it at every
        tick, or as it says a few times a second where no effects are emulated
lost    1 − arrivals · T / time: the share of messages, one due every T, that brought nothing newer;
        at a tick one has arrived if the age grew by less than half a tick
state   OK, ABSENT (a graph that switches has it not at present), DEAD (nothing arrives: the age is
        far beyond what it was, or a fault partitions the edge)
"""

from collections.abc import Collection, Mapping, Sequence
from math import exp, isnan, nan

import numpy as np

from configs.edges import Edge, InEdge, edge_text
from configs.signals import AGE_PREFIX, Signal

OK, ABSENT, DEAD = 0, 1, 2
_DEAD_AGES, _DEAD_PERIODS, _DEAD_S = 4.0, 8.0, 0.25
"""An edge is dead at an age of so many times its mean, and so many periods more, and this time."""
_MEMORY_S, _MEMORY_PERIODS = 1.0, 20.0
"""Ages and losses are means over this time, or over so many periods if that is longer."""


class LiveEdge:
    """One edge between robots.

    Args:
        edge: as its hearer has it.
        hearer: the robot.
        table: of the rows of its controller.
        share_period_s: a message is due so often.
        period_s: of the rows.
    """

    __slots__ = (
        "_arrived",
        "_column",
        "_inedge",
        "_mean_s",
        "_memory_s",
        "_passed_s",
        "_period_s",
        "_share_s",
        "age_s",
        "edge",
        "tick",
    )

    def __init__(
        self,
        edge: InEdge,
        hearer: str,
        table: Sequence[Signal],
        *,
        share_period_s: float,
        period_s: float,
    ) -> None:
        self.edge: Edge = (edge.speaker, hearer)
        self._inedge = edge
        self._share_s, self._period_s = share_period_s, period_s
        self._memory_s = max(_MEMORY_S, _MEMORY_PERIODS * share_period_s)
        name = f"{AGE_PREFIX}{edge.speaker}_s"
        names = [signal.name for signal in table]
        self._column = names.index(name) if name in names else None
        self._mean_s = nan
        self._arrived = self._passed_s = 0.0
        self.age_s = nan
        self.tick = -1

    def add(self, last_tick: int, rows: np.ndarray) -> None:
        """Take rows of the hearer, the last of them of a tick."""
        self.tick = last_tick
        if self._column is None or not len(rows):
            return
        ages = rows[:, self._column]
        grown = np.diff(ages, prepend=self.age_s)
        known = np.isfinite(grown)
        passed_s = float(known.sum()) * self._period_s
        kept = exp(-passed_s / self._memory_s)
        self._arrived = kept * self._arrived + float((grown[known] < 0.5 * self._period_s).sum())
        self._passed_s = kept * self._passed_s + passed_s
        self.age_s = float(ages[-1])
        finite = ages[np.isfinite(ages)]
        if len(finite) and self.state(()) == OK:
            mean_s = float(finite.mean())
            before_s = mean_s if isnan(self._mean_s) else self._mean_s
            self._mean_s = mean_s + kept * (before_s - mean_s)

    def note_age(self, age_s: float) -> None:
        """Take the age that the hearer's controller says, of an edge whose ages aren't recorded."""
        if self._column is None:
            self.age_s = age_s
            self._mean_s = self._share_s

    @property
    def lost(self) -> float:
        """The share of messages that are missing, in [0, 1]."""
        due = self._passed_s / self._share_s
        return 0.0 if due < 1.0 else min(max(1.0 - self._arrived / due, 0.0), 1.0)

    def state(self, cut: Collection[Edge]) -> int:
        """Its state; `cut`: edges that a fault partitions."""
        if not self._inedge.exists(self.tick):
            return ABSENT
        if self.edge in cut:
            return DEAD
        if isnan(self._mean_s):
            return OK
        most = max(_DEAD_AGES * self._mean_s + _DEAD_PERIODS * self._share_s, _DEAD_S)
        return DEAD if self.age_s > most else OK


def cut_edges(faults: Sequence[Mapping[str, object]], edges: Sequence[Edge]) -> set[Edge]:
    """Edges that an acting fault partitions, of the faults as a run's door lists them."""
    acting = [one for one in faults if one.get("state") == "acting"]
    cut = [one for one in acting if one.get("kind") == "link_partition"]
    named = {str(it) for one in cut for it in _list(one.get("targets"))}
    return {edge for edge in edges if edge_text(edge) in named}


def _list(value: object) -> list[object]:
    return list(value) if isinstance(value, list | tuple) else []
