"""Graphs that switch: [[graph.switch]] carried out, before the run, as windows of each edge.

Until the first switch the edges of [graph] exist; from each on, its own:

    edges, generator       this set
    rotate, dwell_s        the sets in turn, each for a dwell
    random, probability    each edge of [graph] for a dwell, if it is drawn
    random, pool           one of the sets for a dwell, drawn

The draws are of a generator of the switch's own seed, so they are the same in every run.
"""

from collections.abc import Iterable, Iterator, Sequence
from math import ceil
from random import Random
from typing import NamedTuple

from configs.edges import FOREVER, LEADER, Edge, Windows, parse_edge
from configs.graph import generated
from configs.graph_section import EdgeSet, Switch

MOST_WINDOWS = 100_000
"""Of all edges in a run: some megabytes in briefs."""


class _Phase(NamedTuple):
    """The edges and leader links from a tick on."""

    from_tick: int
    edges: frozenset[Edge]


def switched(
    base: Sequence[Edge],
    switches: Sequence[Switch],
    robots: Sequence[str],
    period_s: float,
    duration_s: float,
) -> dict[Edge, Windows | None]:
    """The windows of every edge that exists at some time; None: it always does.

    Args:
        base: edges and leader links, (`LEADER`, robot), of [graph].
        switches: in order of time.
        robots: in their order.
        period_s: of control ticks.
        duration_s: of the run.
    """
    if not switches:
        return dict.fromkeys(base, None)
    end = ceil(duration_s / period_s - 1e-6) + 1
    starts = [round(switch.at_s / period_s) for switch in switches]
    phases = [_Phase(0, frozenset(base))]
    for switch, start, until in zip(switches, starts, [*starts[1:], end], strict=True):
        every = max(round((switch.dwell_s or duration_s) / period_s), 1)
        ticks = range(start, min(until, end), every)
        phases += map(_Phase, ticks, edge_sets(switch, base, robots))
    return _windows(phases)


def most_windows(
    base: Sequence[Edge], switches: Sequence[Switch], robots: Sequence[str], duration_s: float
) -> float:
    """Windows that a schedule may come to, before it is carried out."""
    windows = float(len(base))
    for switch in switches:
        edges = len(base)  # of leader links and what is drawn by probability
        if switch.probability is None:
            edges += len(frozenset().union(*_sets(switch, robots)))
        windows += edges * (1 + duration_s / (switch.dwell_s or duration_s))
    return windows


def edge_sets(
    switch: Switch, base: Iterable[Edge], robots: Sequence[str]
) -> Iterator[frozenset[Edge]]:
    """The sets of a switch, one for each dwell, without end."""
    edges = [edge for edge in base if edge[0] != LEADER]
    sets, links = _sets(switch, robots), _links(switch, base)
    draw = Random(switch.seed)
    while True:
        if switch.probability is not None:
            yield links | {edge for edge in edges if draw.random() < switch.probability}
        elif switch.random:
            yield links | sets[int(draw.random() * len(sets))]
        else:
            yield from (links | each for each in sets)


def texts_of(switch: Switch) -> Iterator[tuple[str, str]]:
    """(key, edge) of all edges that a switch names."""
    for key in ("rotate", "pool"):
        for n, each in enumerate(getattr(switch, key) or ()):
            yield from ((f"{key}.{n}", text) for text in each)
    yield from (("edges", text) for text in switch.edges or ())


def names_links(switch: Switch) -> bool:
    """Whether an edge set of a switch has a leader link."""
    edges = (parse_edge(text) for _, text in texts_of(switch))
    return any(edge is not None and edge[0] == LEADER for edge in edges)


def _sets(switch: Switch, robots: Sequence[str]) -> list[frozenset[Edge]]:
    if switch.generator is not None:
        return [frozenset(generated(switch.generator, robots))]
    sets: Sequence[EdgeSet] = switch.rotate or switch.pool or (switch.edges or (),)
    return [frozenset(filter(None, map(parse_edge, each))) for each in sets]


def _links(switch: Switch, base: Iterable[Edge]) -> frozenset[Edge]:
    """The leader links of all sets of a switch, besides those in a set."""
    if switch.leader is not None:
        return frozenset((LEADER, robot) for robot in switch.leader)
    if names_links(switch):
        return frozenset()
    return frozenset(edge for edge in base if edge[0] == LEADER)


def _windows(phases: Iterable[_Phase]) -> dict[Edge, Windows | None]:
    """The windows of each edge, joined where one follows on another."""
    since: dict[Edge, int] = {}
    found: dict[Edge, list[tuple[int, int]]] = {}
    for tick, edges in phases:
        for edge in [edge for edge in since if edge not in edges]:
            start = since.pop(edge)
            if start < tick:
                found[edge].append((start, tick))
        for edge in sorted(edges - since.keys()):
            since[edge] = tick
            found.setdefault(edge, [])
    for edge, start in since.items():
        found[edge].append((start, FOREVER))
    always = [(0, FOREVER)]
    return {
        edge: None if windows == always else tuple(windows)
        for edge, windows in found.items()
        if windows
    }
