"""The verb `graph`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop.options import ScenarioArg, SeedOption, SetOption, overrides_of


def graph(
    scenario: ScenarioArg,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the graph as well: .graphml (yEd, NetworkX), .dot (Graphviz), or a picture,"
            " .svg, .png, .pdf.",
        ),
    ] = None,
    seed: SeedOption = None,
    overrides: SetOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the graph as JSON.")] = False,
) -> None:
    """Show the directed graph: adjacency, leader links, roots, in-degrees, inequality (46)."""
    from fleetloop.graph.command import show_graph

    show_graph(scenario, overrides_of(overrides, seed=seed), out=out, as_json=as_json)
