"""The coordination of a fleet alone: controllers' own parts and emulated edges, without robots."""

from collections.abc import Mapping, Sequence

import numpy as np

from agents.coordination import CoordinationState, Coordinator
from agents.in_edges import InEdges
from agents.neighbours import Neighbours
from bridge.netem.channel import Channel
from configs.graph import Graph
from configs.leader_speed import SpeedChange, speed_at
from configs.netem import Effects
from configs.sections import Coordination

NO_EFFECTS = Effects()


def coordinated_fleet(
    graph: Graph,
    coordination: Coordination,
    ticks: int,
    *,
    h_s: float,
    share_every: int = 1,
    v_r: float = 0.6,
    changes: Sequence[SpeedChange] = (),
    starts: Sequence[float] | None = None,
    effects: Effects = NO_EFFECTS,
    seed: int = 1,
) -> np.ndarray:
    """(ticks + 1, robots, 3): v̂, μ, s.

    Args:
        graph: of the fleet.
        coordination: its gains and limits; all robots begin with its v̂ and μ.
        ticks: how many.
        h_s: control period [s].
        share_every: ticks between two path states.
        v_r: speed of the leader at the start [m/s].
        changes: of that speed.
        starts: s(0) [m]; 0 if not given.
        effects: of every edge.
        seed: of the edges' random streams.
    """
    robots = graph.robots
    receivers = {r: Neighbours(graph.hears[r], coordination, h_s) for r in robots}
    coordinators = {r: Coordinator(coordination, h_s) for r in robots}
    edges = {r: InEdges(graph.hears[r], graph.links.get(r), receivers[r]) for r in robots}
    channels: Mapping[tuple[str, str], Channel[CoordinationState]] = {
        (a, b): Channel(effects, f"{seed} {a} -> {b}", 2_000_000_000) for a, b in graph.edges
    }
    at_start = dict(zip(robots, starts or [0.0] * len(robots), strict=True))
    states = {
        r: CoordinationState(coordination.v_hat_0, coordination.mu_0, at_start[r]) for r in robots
    }
    profile = (SpeedChange(0, v_r), *changes)
    history = np.empty((ticks + 1, len(robots), 3))
    history[0] = [states[r].in_order() for r in robots]
    for tick in range(ticks):
        now_ns = round(tick * h_s * 1e9)
        for r in robots:
            edges[r].follow(tick)
        for (speaker, hearer), channel in channels.items():
            if tick % share_every == 0 and edges[hearer].exists(speaker, tick):
                channel.send(now_ns, states[speaker])
            for sent_ns, said in channel.receive(now_ns):
                receivers[hearer].receive(speaker, sent_ns, said.s, said.v_hat)
        sums = {r: receivers[r].sums(now_ns, states[r].s) for r in robots}
        speed = speed_at(profile, now_ns)
        states = {r: coordinators[r].advance(states[r], sums[r], edges[r].h, speed) for r in robots}
        history[tick + 1] = [states[r].in_order() for r in robots]
    return history
