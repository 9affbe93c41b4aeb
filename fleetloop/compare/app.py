"""The verb `compare`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop import numbers
from fleetloop.options import ClockOption, ScenarioArg, SetOption, listed, overrides_of


def compare(
    scenario: ScenarioArg,
    laws: Annotated[
        str,
        typer.Option(
            metavar="LAW,LAW",
            help="Laws, each with gains of its own if need be: adaptive_dsc,fixed_dsc:factor=3 ."
            " Other gains are those of the scenario that the law has, else its defaults.",
        ),
    ],
    seeds: Annotated[
        str | None,
        typer.Option(metavar="N,N", help="Run each law with each seed. Default: the scenario's."),
    ] = None,
    clock: ClockOption = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Scenario time at which the runs end."),
    ] = None,
    overrides: SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the comparison, new or empty. Default: runs/<time>-<scenario>-laws.",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print compare.json on standard output, no tables.")
    ] = False,
    keep_records: Annotated[
        bool,
        typer.Option(
            "--keep-records", help="Keep record.mcap of each run, for report, export and diff."
        ),
    ] = False,
) -> None:
    """Run laws side by side, in process, on one scenario and the same seeds; one page of it."""
    from fleetloop.compare.command import CompareOptions
    from fleetloop.compare.command import compare as compare_laws

    options = CompareOptions(
        laws=laws,
        seeds=numbers.seeds(listed("--seeds", seeds)),
        overrides=overrides_of(overrides, clock=clock, duration=duration),
        out=out,
        as_json=as_json,
        keep_records=keep_records,
    )
    raise typer.Exit(compare_laws(scenario, options))
