"""The path variable of a robot that is about to join the formation.

    s_i = Σ a_ij s_j / Σ a_ij,   v̂_i = (Σ a_ij v̂_j + h_i v_r) / (Σ a_ij + h_i),   μ_i = 0

with the neighbours' s_j carried on to the tick: where (38) and (45) are in equilibrium. In a fleet
that agrees (s_j = s, v̂_j = v_r, μ_j = 0) nothing changes for the others then; else s_i is between
the neighbours', so max s − min s doesn't grow. With its own place on the path instead, D behind, it
would pull those that hear it back, and what all agree on by β_i D, β of βᵀ L = 0, βᵀ 1 = 1. The
robot's body is where it is: its law drives it to its place.
"""

from agents.coordination import CoordinationState
from agents.neighbours import Neighbours


def joining(
    neighbours: Neighbours, at_ns: int, h: float, v_r: float, start: CoordinationState
) -> CoordinationState:
    """The state of a robot that joins at `at_ns`; `start` if no neighbour is heard."""
    degree, s, v = neighbours.carried_on(at_ns)
    if degree == 0.0:
        return start
    return CoordinationState((v + h * v_r) / (degree + h), 0.0, s / degree)
