"""The verbs `report`, `export`, `diff`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop import numbers
from fleetloop.options import (
    AllOption,
    ByOption,
    PartialOption,
    RunArg,
    ToleranceOption,
    listed,
    size_first,
)


def report(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN...", help="A run's folder, or its record.mcap; or several."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Of several runs: folder of their page, new or empty. Default:"
            " runs/<time>-overlay.",
        ),
    ] = None,
    partial: PartialOption = False,
) -> None:
    """Rebuild report.html and the figures of a run; of several runs, lay them over each other."""
    from fleetloop.results.overlay import write_overlay
    from fleetloop.results.report import write_report
    from fleetloop.results.run_folder import read_record
    from fleetloop.results.tables import print_report

    if out is not None and len(runs) == 1:
        raise typer.BadParameter("--out is for several runs; the page of one is in its folder")
    records = [read_record(run, partial=partial) for run in runs]
    if len(runs) == 1:
        print_report(write_report(runs[0], records[0]))
    else:
        print_report(write_overlay(runs, records, out))


def export(
    run: RunArg,
    target: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.csv|FILE.npz", help="File to write; its extension selects the format."
        ),
    ],
    signals: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Only these signals, in this order, after t_s and robot; 'all' for every recorded"
            " one. Default: truth, path variable, errors, torques.",
        ),
    ] = None,
    robots: Annotated[
        str | None, typer.Option(metavar="R1,R2", help="Only these robots. Default: all.")
    ] = None,
    from_s: Annotated[
        float | None,
        typer.Option(
            "--from",
            callback=numbers.finite,
            metavar="SECONDS",
            help="First scenario time, in seconds.",
        ),
    ] = None,
    to_s: Annotated[
        float | None,
        typer.Option(
            "--to",
            callback=numbers.finite,
            metavar="SECONDS",
            help="Last scenario time, included, in seconds.",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite FILE if it exists.")] = False,
    partial: PartialOption = False,
) -> None:
    """Export one row per tick and robot, each robot up to its own end."""
    from fleetloop.results.export import Selection
    from fleetloop.results.export import export as export_run
    from fleetloop.terminal import say

    chosen = Selection(
        signals=listed("--signals", signals),
        robots=listed("--robots", robots),
        from_s=from_s,
        to_s=to_s,
    )
    rows = export_run(run, target, chosen, force=force, partial=partial)
    say(f"wrote {target}: {rows} rows")


def diff(
    a: Annotated[Path, typer.Argument(metavar="A", help="A run's folder, or its record.mcap.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The other run.")],
    tolerance: ToleranceOption = None,
    by: ByOption = "first",
    whole: AllOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    partial: PartialOption = False,
) -> None:
    """Compare two runs bit for bit, or within a tolerance; rank the signals that differ."""
    from fleetloop.results.diff import print_comparison
    from fleetloop.results.divergence import Tolerance

    status = print_comparison(
        a,
        b,
        as_json=as_json,
        partial=partial,
        tolerance=Tolerance.parse(tolerance or ()),
        size_first=size_first(by),
        whole=whole,
    )
    raise typer.Exit(status)
