"""The verb `live`: arguments only."""

from typing import Annotated

import typer


def live(
    run: Annotated[
        str,
        typer.Argument(
            metavar="RUN",
            help="Name or folder of a run that goes on on this machine; none: the only one.",
            show_default=False,
        ),
    ] = "",
    show: Annotated[
        bool, typer.Option("--open", help="Open the page in this machine's browser.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print the address of a run's page, on which it is seen and controlled."""
    from fleetloop.live.command import open_page

    open_page(run, show=show, as_json=as_json)
