"""Section [graph] of a scenario file: edges, weights, leader links, and how they switch."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal

from annotated_types import Ge, Gt, Le, Len

from configs.edges import Weight
from configs.parameters import (
    FilePath,
    NameOrTable,
    NotNegative,
    Parameters,
    Seconds,
    SecondsOrZero,
    Seed,
    parameter,
)

if TYPE_CHECKING:
    Weights = Literal["unit", "normalised"] | dict[str, Weight]
else:
    Weights = Annotated[
        Literal["unit", "normalised"] | dict[str, Weight],
        NameOrTable('must be "unit", "normalised" or a table of edges, as "r1 -> r2" = 0.5'),
    ]


Shape = Literal["chain", "ring", "tree", "star", "complete"]
EdgeSet = tuple[str, ...]
"""Edges as "r1 -> r2", leader links as "leader -> r1"."""
EdgeSets = Annotated[tuple[EdgeSet, ...], Len(1, 1000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch(Parameters):
    """The graph from a time on, up to the next [[graph.switch]].

    One of `edges`, `generator`, `rotate`, `random`. Leader links stay those of [graph], unless
    `leader` is given or an edge set names one.
    """

    at_s: SecondsOrZero = 0.0
    edges: EdgeSet | None = None
    generator: Shape | None = parameter(None, "a named shape over the robots in their order")
    rotate: EdgeSets | None = parameter(None, "edge sets, one after the other and over again")
    random: bool = parameter(
        False, "what exists is drawn again after every dwell_s: by probability, or from the pool"
    )
    probability: Annotated[float, Gt(0), Le(1)] | None = parameter(
        None, "of each edge of [graph] to exist"
    )
    pool: EdgeSets | None = parameter(None, "edge sets of which one exists")
    dwell_s: Seconds | None = parameter(None, "of rotate and random, from one set to the next")
    seed: Seed = parameter(1, "of random")
    leader: tuple[str, ...] | None = parameter(None, "robots that hear the leader meanwhile")


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSection(Parameters):
    """The directed graph: "r1 -> r2" means that r2 hears r1 (a_21 > 0).

    Its edges are given by one of `edges`, `generator`, `adjacency`, `file`; without any it is a
    chain.
    """

    edges: tuple[str, ...] | None = None
    generator: Literal[Shape, "random"] | None = parameter(
        None, "a named shape over the robots in their order, instead of edges"
    )
    adjacency: Annotated[tuple[tuple[NotNegative, ...], ...], Len(1, 256)] | None = parameter(
        None,
        "rows of a_ij, robots in their order, instead of edges: row i holds the weights of what"
        " robot i hears, 0 of whom it doesn't",
    )
    file: FilePath | None = parameter(
        None,
        "GraphML or DOT, relative to the scenario, instead of edges: its edges, weights and leader"
        " links are taken when the scenario is loaded",
    )
    weights: Weights = field(
        default="unit",
        hash=False,
        metadata={
            "description": "unit: a_ij = 1; normalised: a_ij divided by the in-degree of robot i;"
            ' or a table "r1 -> r2" = a_21, "leader -> r1" = h_1, 1 where not given'
        },
    )
    max_in_degree: Annotated[int, Ge(1), Le(256)] = parameter(2, "of the random graph")
    seed: Seed = parameter(1, "of the random graph")
    leader: tuple[str, ...] | None = parameter(
        None, "robots that hear the virtual leader; the first one if not given"
    )
    switch: Annotated[tuple[Switch, ...], Len(0, 1000)] = parameter(
        (), "other edges from a time on, one [[graph.switch]] each"
    )
