"""Edges of the fleet's graph as the robot at their head has them.

edge "j -> i"         a_ij > 0    information flows from j to i: i hears j
edge "leader -> i"    h_i > 0     i hears the virtual leader's speed
"""

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


@dataclass(frozen=True, slots=True)
class InEdge:
    """An edge to a robot."""

    speaker: str  # the robot that is heard, or `LEADER`
    weight: float = 1.0  # a_ij, of a leader link h_i [1/s]


def parse_edge(text: str) -> Edge | None:
    """(speaker, hearer) of "r1 -> r2", None if it isn't an edge."""
    speaker, arrow, hearer = (part.strip() for part in text.partition("->"))
    return (speaker, hearer) if arrow and speaker and hearer else None


def edge_text(edge: Edge) -> str:
    """An edge as files have it."""
    return " -> ".join(edge)
