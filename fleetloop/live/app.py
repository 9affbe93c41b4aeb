"""The verb `live`: arguments only."""

from typing import Annotated

import typer

from fleetloop.options import GoingOnArg, JsonOption


def live(
    run: GoingOnArg = "",
    show: Annotated[
        bool, typer.Option("--open", help="Open the page in this machine's browser.")
    ] = False,
    foxglove: Annotated[
        bool,
        typer.Option(
            "--foxglove",
            help="The address of a Foxglove WebSocket instead, for Foxglove or Lichtblick: the"
            " channels of the record as they come (needs the extra foxglove).",
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Print the address of a run's page, on which it is seen and controlled."""
    from fleetloop.live.command import open_page, open_stream

    if foxglove:
        open_stream(run, show=show, as_json=as_json)
    else:
        open_page(run, show=show, as_json=as_json)
