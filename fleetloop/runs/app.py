"""The verbs `ps` and `stop`: arguments only."""

from typing import Annotated

import typer

from fleetloop.numbers import between
from fleetloop.options import ForceOption, GoingOnArg, JsonOption


def ps(as_json: JsonOption = False) -> None:
    """List the runs that go on on this machine: name, scenario, state, time, process, folder."""
    from fleetloop.runs.listing import list_runs

    list_runs(as_json=as_json)


def stop(
    run: GoingOnArg = "",
    within: Annotated[
        float,
        typer.Option(
            callback=between(0.1, 3600.0), metavar="S", help="Longest time to wait for its end."
        ),
    ] = 60.0,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """End a run as Ctrl-C does, wait for its end and say how it ended: its record is kept."""
    from fleetloop.runs.stopping import stop_run

    raise typer.Exit(stop_run(run, within_s=within, force=force, as_json=as_json))
