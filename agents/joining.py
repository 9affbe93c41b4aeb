"""The path variable of a robot that joins the formation late, or again.

    s_i = Σ a_ij s_j / Σ a_ij,   v̂_i = (Σ a_ij v̂_j + h_i v_r) / (Σ a_ij + h_i),   μ_i = 0

with the neighbours' s_j carried on to the tick: where (38) and (45) are in equilibrium. In a fleet
that agrees (s_j = s, v̂_j = v_r, μ_j = 0) nothing changes for the others then; else s_i is between
the neighbours', so max s − min s doesn't grow. With its own place on the path instead, D behind, it
would pull those that hear it back, and what all agree on by β_i D, β of βᵀ L = 0, βᵀ 1 = 1. The
robot's body is where it is: its law drives it to its place.

A controller that was started again in a run that goes on takes it likewise, once it knows its pose,
the leader and a neighbour. One without in-neighbours heard only the leader, whose profile it knows:
its (38), (40) and (45) are repeated from t = 0, so its path variable goes on as if nothing had
happened. One that is linked to the leader and hears none of its in-neighbours for as long as a
silent one counts does the same: they may wait for it, as where robots that hear only each other
were all started again. The others hear it then: the graph has a path from the leader to each.
"""

from collections.abc import Callable
from typing import Final

from agents.coordination import CoordinationState, Coordinator
from agents.in_edges import InEdges
from agents.neighbours import Neighbours, Sums
from bridge.network.messages import LeaderSpeed
from configs.brief import AgentBrief
from configs.edges import FOREVER
from configs.leader_speed import speed_at

_NOBODY: Final = Sums(0, 0.0, 0.0, 0.0)


class Joining:
    """When a robot is part of the formation, and its path variable before that."""

    __slots__ = (
        "_awaits",
        "_brief",
        "_coordinator",
        "_edges",
        "_neighbours",
        "_since_tick",
        "_start",
        "joins",
    )

    def __init__(
        self,
        brief: AgentBrief,
        neighbours: Neighbours,
        edges: InEdges,
        coordinator: Coordinator,
        start: CoordinationState,
    ) -> None:
        self._brief = brief
        self._neighbours = neighbours
        self._edges = edges
        self._coordinator = coordinator
        self._start = start
        self._awaits = brief.rejoins  # what it needs to know to re-join
        self._since_tick = FOREVER  # from when on nothing but a neighbour was missing
        self.joins = FOREVER if brief.rejoins else brief.membership.joins_tick
        """The first tick of its membership."""

    def state(
        self, tick: int, v_r: float, leader: LeaderSpeed | None, *, located: bool
    ) -> CoordinationState:
        """The state with which the robot would join at a tick.

        Args:
            tick: the next one.
            v_r: of the leader, as it is heard.
            leader: its profile, if that is known.
            located: whether the robot's pose is known.
        """
        period_ns = self._brief.schedule.period_ns
        if self._awaits and located and (leader is not None or self._brief.leader_link is None):
            self._rejoin(tick, leader)
        return joining(self._neighbours, tick * period_ns, self._edges.h, v_r, self._start)

    def _rejoin(self, tick: int, leader: LeaderSpeed | None) -> None:
        """Join at the next tick, unless an in-neighbour is to be heard first."""
        period_ns = self._brief.schedule.period_ns
        self._since_tick = min(tick, self._since_tick)
        listened_s = (tick - self._since_tick) * period_ns * 1e-9
        if not self._neighbours.carried_on(tick * period_ns)[0]:
            waits = leader is None or listened_s < self._brief.coordination.silence_limit_s
            if self._brief.hears and waits:
                return

            def v_r(k: int) -> float:
                return 0.0 if leader is None else speed_at(leader.changes, k * period_ns)

            self._start = repeated(self._start, self._coordinator, self._edges.h, v_r, tick)
        self._awaits = False
        self.joins = max(tick, self._brief.membership.joins_tick)


def joining(
    neighbours: Neighbours, at_ns: int, h: float, v_r: float, start: CoordinationState
) -> CoordinationState:
    """The state of a robot that joins at `at_ns`; `start` if no neighbour is heard."""
    degree, s, v = neighbours.carried_on(at_ns)
    if degree == 0.0:
        return start
    return CoordinationState((v + h * v_r) / (degree + h), 0.0, s / degree)


def repeated(
    start: CoordinationState,
    coordinator: Coordinator,
    h: float,
    v_r: Callable[[int], float],
    ticks: int,
) -> CoordinationState:
    """The state after so many ticks of a robot without in-neighbours; `v_r`: by tick [m/s]."""
    state = start
    for tick in range(ticks):
        state = coordinator.advance(state, _NOBODY, h, v_r(tick))
    return state
