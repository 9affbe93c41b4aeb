"""The verb `test`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop import numbers
from fleetloop.options import JsonLinesOption, JunitOption, SetOption, refuse_both

_bound = numbers.between(0.1, numbers.LONGEST_S)


def test(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATH...", help="Scenario files, folders of them, names of shipped ones."
        ),
    ],
    select: Annotated[
        str,
        typer.Option("-k", metavar="EXPR", help="Only these: words of a path, and, or, not, ( )."),
    ] = "",
    processes: Annotated[
        bool,
        typer.Option(
            "--processes",
            help="Run over processes, one after the other. Default: in one process, which is the"
            " same bit for bit; real time and faults of processes never.",
        ),
    ] = False,
    jobs: Annotated[
        int, typer.Option(min=0, metavar="N", help="Runs at a time; 0: one per processor.")
    ] = 0,
    timeout: Annotated[
        float, typer.Option(callback=_bound, metavar="SECONDS", help="Longest time of a run.")
    ] = 600.0,
    total: Annotated[
        float, typer.Option(callback=_bound, metavar="SECONDS", help="Longest time of all.")
    ] = 3600.0,
    overrides: SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the runs, new or empty. Default: runs/<time>-test. Runs that held are"
            " removed.",
        ),
    ] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the runs that held, too.")] = False,
    junit: JunitOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print all outcomes as JSON, no lines.")
    ] = False,
    json_lines: JsonLinesOption = False,
) -> None:
    """Run every scenario of files and folders as a test: what each expects has to hold."""
    from fleetloop.suite.command import SuiteOptions, run_tests

    refuse_both(as_json, json_lines)

    options = SuiteOptions(
        select=select,
        processes=processes,
        jobs=jobs,
        timeout_s=timeout,
        total_s=total,
        overrides=tuple(overrides or ()),
        out=out,
        keep=keep,
        as_json=as_json,
        json_lines=json_lines,
        junit=junit,
    )
    raise typer.Exit(run_tests(paths, options))
