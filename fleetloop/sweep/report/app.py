"""The verb `sweep report`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

_WORST = 20


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="The folder of a study, done or not.")
    ],
    x: Annotated[
        str | None,
        typer.Option(
            "--x",
            metavar="COLUMN",
            help="Horizontal axis of the map: a factor, a quantity, or of (46) p2_q and im2_re."
            " Default: the factors with the largest effects.",
        ),
    ] = None,
    y: Annotated[
        str | None, typer.Option("--y", metavar="COLUMN", help="Its vertical axis.")
    ] = None,
    color: Annotated[
        str | None,
        typer.Option(
            "--color",
            metavar="RESULT",
            help="What is mapped and ranked: failure_rate, margin, or a quantity. Default: the"
            " first of these that varies.",
        ),
    ] = None,
    worst: Annotated[
        int,
        typer.Option(min=0, max=1000, metavar="N", help="Rows of the table of the worst cases."),
    ] = _WORST,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the numbers of the report as JSON.")
    ] = False,
) -> None:
    """Make a page and figures of a study: failure rate, map, main effects, worst cases."""
    from fleetloop.sweep.report.command import write_report
    from fleetloop.sweep.report.view import Choice

    write_report(folder, Choice(x, y, color, worst), as_json=as_json)
