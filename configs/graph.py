"""The directed graph of a fleet: edges between robots, and links to the virtual leader.

    edge "j -> i"    information flows from j to i: i hears j, a_ij > 0 (1 if not given)
    L = diag(Σ_j a_ij) − A        H = diag(h_i), h_i > 0 iff i hears the leader

Two conditions are needed for the robots to move abreast at the leader's speed: the leader reaches
every robot (L + H is nonsingular), and the robots' own graph is rooted: one robot reaches all
others (L has a simple zero eigenvalue). Text about directed graphs often turns the arrows round;
here a root is a robot that *reaches* all others along the flow of information.

Of a graph that switches, edges have windows of ticks (`configs.switching`). Its edges, roots and
matrices are those of the union over all times; `at` and `phases` give what exists at one time.
"""

import itertools
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from configs.edges import FOREVER, LEADER, Edge, InEdge, Windows, next_change

if TYPE_CHECKING:
    import networkx as nx

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Graph:
    """Edges and leader links with their weights, in the order of the robots."""

    robots: tuple[str, ...]
    hears: Mapping[str, tuple[InEdge, ...]]  # edges to each robot, sorted by speaker
    links: Mapping[str, InEdge]  # from the leader, by robot: h_i

    @classmethod
    def of(
        cls,
        robots: Sequence[str],
        edges: Iterable[Edge],
        leader: Sequence[str],
        weights: Mapping[Edge, float] | None = None,
        windows: Mapping[Edge, Windows | None] | None = None,
    ) -> "Graph":
        """A graph from (speaker, hearer) pairs and robots that hear the leader.

        Args:
            robots: all of them.
            edges: between robots.
            leader: robots with h_i > 0.
            weights: a_ij, h_i by edge; 1 if not given.
            windows: of edges that exist at times only.
        """
        weight, times = (weights or {}).get, (windows or {}).get

        def in_edge(edge: Edge) -> InEdge:
            return InEdge(edge[0], weight(edge, 1.0), times(edge))

        speakers: dict[str, set[str]] = {robot: set() for robot in robots}
        for speaker, hearer in edges:
            speakers[hearer].add(speaker)
        hears = {
            robot: tuple(in_edge((other, robot)) for other in sorted(heard))
            for robot, heard in speakers.items()
        }
        links = {robot: in_edge((LEADER, robot)) for robot in leader}
        return cls(tuple(robots), hears, links)

    @property
    def edges(self) -> tuple[Edge, ...]:
        """All (speaker, hearer) pairs of robots."""
        return tuple((edge.speaker, i) for i in self.robots for edge in self.hears[i])

    @property
    def leader(self) -> tuple[str, ...]:
        """Robots that hear the leader."""
        return tuple(self.links)

    @property
    def in_neighbours(self) -> dict[str, tuple[str, ...]]:
        """The robots that each robot hears, sorted."""
        return {i: tuple(edge.speaker for edge in heard) for i, heard in self.hears.items()}

    @property
    def max_in_degree(self) -> float:
        """d_max, the largest in-degree d_i."""
        return max(map(self.in_degree, self.robots))

    @property
    def windows(self) -> dict[Edge, Windows | None]:
        """The windows of all edges and leader links; None: always."""
        return {
            (edge.speaker, robot): edge.windows
            for robot in self.robots
            for edge in self._all_to(robot)
        }

    @property
    def switches(self) -> bool:
        """Whether edges come and go."""
        return any(edge.windows is not None for edge in self.in_edges)

    def phases(self) -> Iterator[tuple[int, "Graph"]]:
        """The graphs without windows that exist in turn, with the ticks at which they begin."""
        tick, in_edges = 0, self.in_edges
        while tick < FOREVER:
            yield tick, self.at(tick)
            tick = next_change(in_edges, tick)

    def at(self, tick: int) -> "Graph":
        """The edges and links that exist at a tick."""
        hears = {
            robot: tuple(replace(edge, windows=None) for edge in heard if edge.exists(tick))
            for robot, heard in self.hears.items()
        }
        links = {
            robot: replace(link, windows=None)
            for robot, link in self.links.items()
            if link.exists(tick)
        }
        return Graph(self.robots, hears, links)

    @property
    def in_edges(self) -> tuple[InEdge, ...]:
        """All edges and leader links."""
        return tuple(edge for robot in self.robots for edge in self._all_to(robot))

    def in_degree(self, robot: str) -> float:
        """d_i = Σ_j a_ij, summed in the order of names; the largest at one time if it switches."""
        heard, tick = self.hears[robot], 0
        largest = 0.0
        while tick < FOREVER:
            largest = max(largest, sum(edge.weight for edge in heard if edge.exists(tick)))
            tick = next_change(heard, tick)
        return largest

    def normalised(self) -> "Graph":
        """The same edges with a_ij / d_i, so that every in-degree is 1 or 0."""
        hears = {}
        for robot, heard in self.hears.items():
            degree = self.in_degree(robot)
            hears[robot] = tuple(replace(edge, weight=edge.weight / degree) for edge in heard)
        return replace(self, hears=hears)

    def adjacency(self) -> Matrix:
        """A, N × N: a_ij > 0 iff robot i hears robot j."""
        index = {robot: n for n, robot in enumerate(self.robots)}
        matrix = np.zeros((len(self.robots), len(self.robots)))
        for robot, heard in self.hears.items():
            for edge in heard:
                matrix[index[robot], index[edge.speaker]] = edge.weight
        return matrix

    def laplacian(self) -> Matrix:
        """L, N × N, row sums 0."""
        adjacency = self.adjacency()
        return np.diag(adjacency.sum(axis=1)) - adjacency

    def roots(self) -> tuple[str, ...]:
        """Robots that reach all others."""
        everybody = np.all(self._reached(), axis=0)
        return tuple(itertools.compress(self.robots, everybody))

    def unreached_from(self, speakers: Iterable[str]) -> tuple[str, ...]:
        """Robots that none of these robots reaches, directly or through others."""
        speaking = set(speakers)
        columns = [robot in speaking for robot in self.robots]
        unreached = ~np.any(self._reached()[:, columns], axis=1)
        return tuple(itertools.compress(self.robots, unreached))

    def _reached(self) -> NDArray[np.bool_]:
        """N × N: whether robot i is reached by robot j, itself included: (I + A)^N > 0."""
        reached = self.adjacency() + np.eye(len(self.robots)) > 0.0
        for _ in range(len(self.robots).bit_length()):
            reached = reached.astype(np.float32) @ reached > 0.0
        return reached

    def digraph(self) -> "nx.DiGraph":
        """The graph as networkx has it, weights on its edges, the leader a node like the robots."""
        import networkx as nx  # runs do without: it takes as long to import as a run to start

        digraph = nx.DiGraph()
        digraph.add_nodes_from((LEADER, *self.robots))
        for robot in self.robots:
            for edge in self._all_to(robot):
                digraph.add_edge(edge.speaker, robot, weight=edge.weight)
        return digraph

    def _all_to(self, robot: str) -> tuple[InEdge, ...]:
        link = self.links.get(robot)
        return self.hears[robot] if link is None else (*self.hears[robot], link)


def generated(kind: str, robots: Sequence[str]) -> list[Edge]:
    """Edges of a named shape over the robots in their order; the first robot is a root.

    chain 1→2→3…, ring (chain closed), tree (binary: n hears n // 2), star (all hear the first),
    complete (all hear all).
    """
    chain = list(itertools.pairwise(robots))
    match kind:
        case "chain":
            return chain
        case "ring":
            return [*chain, (robots[-1], robots[0])] if len(robots) > 1 else []
        case "tree":
            return [(robots[(n + 1) // 2 - 1], robots[n]) for n in range(1, len(robots))]
        case "star":
            return [(robots[0], other) for other in robots[1:]]
        case "complete":
            return [(a, b) for a in robots for b in robots if a != b]
    raise ValueError(f"no generator {kind!r}")


def random_rooted(robots: Sequence[str], *, max_in_degree: int, seed: int) -> list[Edge]:
    """Edges of a random graph in which the first robot reaches all others.

    Every other robot hears one robot before it in a random order, so a tree spans the graph, and up
    to `max_in_degree` robots in all. The same seed gives the same graph.
    """
    draw = random.Random(seed)
    order = [robots[0], *draw.sample(list(robots[1:]), len(robots) - 1)]
    edges = []
    for n, robot in enumerate(order):
        heard = [order[draw.randrange(n)]] if n else []
        others = [other for other in order if other != robot and other not in heard]
        more = min(draw.randint(0, max_in_degree - len(heard)), len(others))
        edges += [(speaker, robot) for speaker in [*heard, *draw.sample(others, more)]]
    return edges


def random_ring(robots: Sequence[str], *, max_in_degree: int, seed: int) -> list[Edge]:
    """Edges of a random ring with chords: each robot reaches all others.

    Every robot hears the one before it in a random order, the first one the last, and up to
    `max_in_degree` robots in all; one robot alone hears none. The same seed gives the same graph.
    Most of these graphs have complex eigenvalues of L, of `random_rooted` most small ones have not.
    """
    draw = random.Random(seed)
    order = draw.sample(list(robots), len(robots))
    edges = []
    for n, robot in enumerate(order):
        before = order[n - 1]
        others = [other for other in order if other not in (robot, before)]
        more = min(draw.randint(0, max_in_degree - 1), len(others))
        heard = [before, *draw.sample(others, more)] if before != robot else []
        edges += [(speaker, robot) for speaker in heard]
    return edges


def of_matrix(robots: Sequence[str], rows: Sequence[Sequence[float]]) -> dict[Edge, float]:
    """Weights of the edges of an adjacency matrix: row i holds a_ij, what robot i hears."""
    return {
        (speaker, hearer): weight
        for hearer, row in zip(robots, rows, strict=True)
        for speaker, weight in zip(robots, row, strict=True)
        if weight
    }
