"""The verb `doctor`: arguments only."""

from typing import Annotated

import typer

from fleetloop.numbers import between
from fleetloop.options import JsonOption


def doctor(
    rate: Annotated[
        float | None,
        typer.Option(
            callback=between(1.0, 10_000.0),
            metavar="HZ",
            help="Control rate in real time that this machine has to hold.",
        ),
    ] = None,
    seconds: Annotated[
        float,
        typer.Option("--for", callback=between(0.05, 600.0), metavar="S", help="Measure so long."),
    ] = 1.0,
    as_json: JsonOption = False,
) -> None:
    """Examine this machine: can it hold a rate, what is missing, what is left over; remedies."""
    from fleetloop.doctor.command import doctor as examine

    raise typer.Exit(examine(rate_hz=rate, seconds=seconds, as_json=as_json))
