"""The verb `replay`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop.options import (
    AllOption,
    ByOption,
    PartialOption,
    RunArg,
    SetOption,
    ToleranceOption,
    listed,
    size_first,
)


def replay(
    run: RunArg,
    robot: Annotated[
        str, typer.Option("--robot", metavar="NAME", help="The robot whose controller is replayed.")
    ],
    overrides: SetOption = None,
    law: Annotated[
        str | None,
        typer.Option(
            metavar="LAW|FILE:LAW[:GAIN=VALUE]",
            help="Another law on the same inputs: a shipped one, or a class in a Python file.",
        ),
    ] = None,
    tolerance: ToleranceOption = None,
    by: ByOption = "first",
    whole: AllOption = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png|.svg|.pdf", help="Draw recorded and replayed signals over each other."
        ),
    ] = None,
    signals: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="The signals of the figure. Default: torques and what differs most.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    partial: PartialOption = False,
) -> None:
    """Feed one robot's recorded inputs to its controller again; name where its outputs part."""
    from fleetloop.replay.command import ReplayOptions, replay_run
    from fleetloop.results.divergence import Tolerance

    options = ReplayOptions(
        robot=robot,
        sets=tuple(overrides or ()),
        law=law,
        tolerance=Tolerance.parse(tolerance or ()),
        size_first=size_first(by),
        whole=whole,
        out=out,
        signals=listed("--signals", signals),
        as_json=as_json,
        partial=partial,
    )
    raise typer.Exit(replay_run(run, options))
