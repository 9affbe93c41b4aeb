"""The coordination of a scenario over its emulated network: the controllers' own parts, no robots.

`Neighbours`, `Coordinator` and `Channel` are the run's, with the run's seeds: delays and losses
that this forecast meets are those that the run will meet. Only time is coarser: between two shares
robots advance in steps of up to `STEP_S`, by exact maps. Where losses depend on the distance of two
robots, they are as far apart as their paths.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil, hypot, nan

import numpy as np

from agents.coordination import CoordinationState, Coordinator, Three
from agents.in_edges import InEdges
from agents.joining import joining
from agents.laws.interface import RobotPath
from agents.neighbours import Neighbours
from bridge.netem.channel import Channel
from configs.edges import LEADER, Edge
from configs.emulated_edges import EmulatedEdge, edges_of, effects_of
from configs.netem import LOCALISATION, Effects
from configs.scenario import Scenario
from fleetloop.check.coordination import HORIZON_S, STEP_S, Forecast, Matrix, members_at
from fleetloop.results.summary import leader_speed

WORK = 300_000
"""Steps of robots and edges, at most: about a second of processor time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EmulatedForecast(Forecast):
    """A forecast with the ages of what is heard, between robots and over emulated leader links.

    NaN where nothing has been heard. Rows are instants, columns `edges`.
    """

    edges: tuple[Edge, ...]
    age_s: Matrix


def needs_emulation(scenario: Scenario) -> bool:
    """Whether the closed forecast, of values that arrive at once, isn't what will happen."""
    gains = scenario.coordination
    plain = gains.compensation == "extrapolate"
    return not (plain and gains.silence_limit_s >= scenario.clock.share_period_s) or any(
        effects_of(scenario.network, edge) != Effects()
        for edge in edges_of(scenario.topology)
        if edge.source != LOCALISATION
    )


def emulated_forecast(scenario: Scenario, path_of: Callable[[str], RobotPath]) -> EmulatedForecast:
    """The path variables of a scenario, up to its end, `HORIZON_S` or the end of `WORK`.

    `path_of` gives the path of a robot.
    """
    clock, graph = scenario.clock, scenario.topology
    per_share = ceil(clock.share_period_s / STEP_S - 1e-9)
    step_s = clock.share_period_s / per_share
    end_s = min(max(scenario.duration_s, scenario.ends_at_s), HORIZON_S)
    work = len(graph.robots) + len(graph.edges)
    steps = min(max(ceil(end_s / step_s), 1), max(WORK // work, 2 * per_share)) + 1
    fleet = _Fleet(scenario, step_s, path_of)
    times = np.arange(steps, dtype=np.float64) * step_s
    speeds = leader_speed(scenario)(np.round(times * 1e9))
    states = np.empty((steps, len(graph.robots), 3))
    ages = np.empty((steps, len(fleet.edges)))
    for n in range(steps):
        states[n] = fleet.states()
        now_ns = round(times[n] * 1e9)
        ages[n] = fleet.advance(now_ns, float(speeds[n]), shares=n % per_share == 0)
    v_hat, mu, s = (states[:, :, n] for n in range(3))
    return EmulatedForecast(
        t_s=times,
        s=s,
        s_dot=v_hat + mu,
        v_hat=v_hat,
        v_r=speeds,
        there=members_at(scenario, times),
        edges=fleet.edges,
        age_s=ages,
    )


class _Fleet:
    """The coordinations of all robots, and the edges between them."""

    def __init__(
        self, scenario: Scenario, step_s: float, path_of: Callable[[str], RobotPath]
    ) -> None:
        graph, gains = scenario.topology, scenario.coordination
        self._graph = graph
        self._silence_ns = round(gains.silence_limit_s * 1e9)
        self._hearing = {r: Neighbours(graph.hears[r], gains, step_s) for r in graph.robots}
        self._edges_to = {
            r: InEdges(graph.hears[r], graph.links.get(r), self._hearing[r]) for r in graph.robots
        }
        self._period_ns = round(scenario.clock.control_period_s * 1e9)
        self._coordinators = {r: Coordinator(gains, step_s) for r in graph.robots}
        self._states = {
            robot.name: CoordinationState(gains.v_hat_0, gains.mu_0, robot.s_0)
            for robot in scenario.robot
        }
        self._starts = dict(self._states)
        self._members, self._step_ns = scenario.members, round(step_s * 1e9)
        effects = {edge: effects_of(scenario.network, edge) for edge in edges_of(graph)}
        self._channels: Mapping[EmulatedEdge, Channel[tuple[float, float]]] = {
            edge: Channel(of_edge, f"{scenario.seed} {edge.source} -> {edge.hearer}", 0)
            for edge, of_edge in effects.items()
            if edge.source in graph.robots or (edge.source == LEADER and of_edge != Effects())
        }
        near = {edge for edge, of_edge in effects.items() if of_edge.distance is not None}
        self._paths = {
            robot: path_of(robot) for edge in near for robot in (edge.source, edge.hearer)
        }
        self.edges: tuple[Edge, ...] = tuple(self._channels)
        self._newest_ns: dict[EmulatedEdge, int | None] = dict.fromkeys(self._channels)
        self._v_r: dict[str, float] = {}

    def states(self) -> list[Three]:
        return [self._states[robot].in_order() for robot in self._graph.robots]

    def advance(self, now_ns: int, v_r: float, *, shares: bool) -> list[float]:
        """One step of all robots; the ages of what each edge's hearer knows [s]."""
        tick = round(now_ns / self._period_ns)
        for edges in self._edges_to.values():
            edges.follow(tick)
        ages = [
            self._exchange(edge, channel, now_ns, v_r, shares=shares)
            if self._exists(edge, tick)
            else self._lose(edge, channel, now_ns)
            for edge, channel in self._channels.items()
        ]
        for robot, state in self._states.items():
            sums = self._hearing[robot].sums(now_ns, state.s)
            heard_v_r = self._leader_speed(robot, now_ns, v_r, state.v_hat)
            h, member = self._edges_to[robot].h, self._members[robot]
            if tick >= member.leaves_tick:
                after = CoordinationState(0.0, 0.0, state.s)
            elif tick < member.joins_tick:
                next_ns = now_ns + self._step_ns
                start = self._starts[robot]
                after = joining(self._hearing[robot], next_ns, h, heard_v_r, start)
            else:
                after = self._coordinators[robot].advance(state, sums, h, heard_v_r)
            self._states[robot] = after
        return ages

    def _exists(self, edge: EmulatedEdge, tick: int) -> bool:
        edges = self._edges_to[edge.hearer]
        return edges.h > 0.0 if edge.source == LEADER else edges.exists(edge.source, tick)

    def _lose(
        self, edge: EmulatedEdge, channel: Channel[tuple[float, float]], now_ns: int
    ) -> float:
        """Of an edge that doesn't exist: what is due is lost, and nothing known any more."""
        channel.receive(now_ns, exists=False)
        self._newest_ns[edge] = None
        return nan

    def _exchange(
        self,
        edge: EmulatedEdge,
        channel: Channel[tuple[float, float]],
        now_ns: int,
        v_r: float,
        *,
        shares: bool,
    ) -> float:
        source, hearer = edge
        if shares:
            state = self._states.get(source)
            said = (v_r, v_r) if state is None else (state.s, state.v_hat)
            channel.send(now_ns, said, self._apart_m(edge))
        newest = self._newest_ns[edge]
        for sent_ns, (first, second) in channel.receive(now_ns):
            if newest is None or sent_ns >= newest:
                newest = sent_ns
                if source == LEADER:
                    self._v_r[hearer] = first
                else:
                    self._hearing[hearer].receive(source, sent_ns, first, second)
        self._newest_ns[edge] = newest
        return nan if newest is None else (now_ns - newest) * 1e-9

    def _leader_speed(self, robot: str, now_ns: int, v_r: float, without: float) -> float:
        edge = EmulatedEdge(LEADER, robot)
        if edge not in self._channels:  # a profile, known from the start
            return v_r
        newest = self._newest_ns[edge]
        heard = newest is not None and now_ns - newest <= self._silence_ns
        return self._v_r[robot] if heard else without

    def _apart_m(self, edge: EmulatedEdge) -> float:
        if edge.source not in self._paths:
            return 0.0
        there, here = (self._paths[robot](self._states[robot].s) for robot in edge)
        return hypot(there.x - here.x, there.y - here.y)
