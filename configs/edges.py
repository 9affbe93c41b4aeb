"""Edges of the fleet's graph as the robot at their head has them.

    "j -> i"         a_ij > 0    information flows from j to i: i hears j
    "leader -> i"    h_i > 0     i hears the virtual leader's speed

Of a graph that switches, an edge exists in windows of ticks, the first included, the last not.
"""

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

LEADER = "leader"
"""The virtual leader's name in an edge; no robot has it."""
LEAST_WEIGHT, MOST_WEIGHT = 1e-3, 1e3
"""Weights beyond are no coupling, or one that no sharing rate follows."""
Weight = Annotated[float, Ge(LEAST_WEIGHT), Le(MOST_WEIGHT)]
Edge = tuple[str, str]
"""(speaker, hearer)"""


Windows = tuple[tuple[int, int], ...]
"""(from_tick, to_tick) in order of time, apart from each other."""
FOREVER = 1 << 61
"""The end of a window that no tick of a run ends; as large as compiled code compares at once."""


@dataclass(frozen=True, slots=True)
class InEdge:
    """An edge to a robot."""

    speaker: str  # the robot that is heard, or `LEADER`
    weight: float = 1.0  # a_ij, of a leader link h_i [1/s]
    windows: Windows | None = None  # in which it exists; None: always

    def exists(self, tick: int) -> bool:
        """Whether the edge exists at a tick; before control begins, whether it does at tick 0."""
        if self.windows is None:
            return True
        tick = max(tick, 0)
        begun = self._begun(self.windows, tick)
        return begun > 0 and tick < self.windows[begun - 1][1]

    def is_over(self, tick: int) -> bool:
        """Whether the edge exists neither at this tick nor at a later one."""
        return self.windows is not None and tick >= self.windows[-1][1]

    def next_change(self, tick: int) -> int:
        """The first tick after this one at which the edge comes or goes, `FOREVER` if none."""
        windows = self.windows or ()
        begun = self._begun(windows, tick)
        if begun and tick < windows[begun - 1][1]:
            return windows[begun - 1][1]
        return windows[begun][0] if begun < len(windows) else FOREVER

    @staticmethod
    def _begun(windows: Windows, tick: int) -> int:
        """How many windows begin at or before a tick."""
        return bisect_right(windows, (tick, FOREVER))


def next_change(edges: Iterable[InEdge], tick: int) -> int:
    """The first tick after this one at which one of the edges comes or goes."""
    return min((edge.next_change(tick) for edge in edges), default=FOREVER)


def parse_edge(text: str) -> Edge | None:
    """(speaker, hearer) of "r1 -> r2", None if it isn't an edge."""
    speaker, arrow, hearer = (part.strip() for part in text.partition("->"))
    return (speaker, hearer) if arrow and speaker and hearer else None


def edge_text(edge: Edge) -> str:
    """An edge as files have it."""
    return " -> ".join(edge)


def hearer(target: str) -> str:
    """The robot that a target concerns: of an edge the one that hears, of a robot itself."""
    edge = parse_edge(target)
    return target if edge is None else edge[1]


def presence(windows: Windows | None, ticks: int) -> tuple[float, int]:
    """The part of a run's ticks in which an edge exists, and its longest absence [ticks]."""
    if windows is None:
        return 1.0, 0
    there, last, longest = 0, 0, 0
    for begin, end in (*windows, (ticks, ticks)):
        longest = max(longest, min(begin, ticks) - last)
        last = min(end, ticks)
        there += max(last - begin, 0)
    return there / ticks, longest
