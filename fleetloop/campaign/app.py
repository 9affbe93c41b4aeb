"""The verb `campaign`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from configs.errors import ScenarioError
from fleetloop import numbers
from fleetloop.options import (
    JsonLinesOption,
    JunitOption,
    ScenarioArg,
    SetOption,
    listed,
    refuse_both,
)

_FOR_S, _RECOVER_S, _HOLD_S, _LIMIT_S = 2.0, 5.0, 1.0, 300.0


def campaign(
    scenario: Annotated[str | None, ScenarioArg.__metadata__[0]] = None,
    faults: Annotated[
        str, typer.Option(metavar="all|KIND,KIND", help="Kinds of faults (docs/faults.md).")
    ] = "all",
    at: Annotated[
        str | None,
        typer.Option(
            metavar="FROM:TO:STEP|T,T",
            help=r"Times at which the fault begins \[s], as 5:25:5. Default: half of duration_s.",
        ),
    ] = None,
    seeds: Annotated[
        str | None,
        typer.Option(
            metavar="COUNT|N,N", help="So many seeds from the scenario's on, or these. Default: 1."
        ),
    ] = None,
    robots: Annotated[
        str | None,
        typer.Option(
            metavar="R,R", help="Robots that have the fault, all at once. Default: the first."
        ),
    ] = None,
    lasting: Annotated[
        float,
        typer.Option("--for", metavar="SECONDS", help="Duration of faults that are no instant."),
    ] = _FOR_S,
    recover_within: Annotated[
        float,
        typer.Option(
            metavar="SECONDS", help="All expectations hold again so long after the fault's end."
        ),
    ] = _RECOVER_S,
    hold: Annotated[
        float, typer.Option(metavar="SECONDS", help="And from then on for so long at least.")
    ] = _HOLD_S,
    param: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND.KEY=VALUE",
            help="A parameter of a kind, as push.force_body_N=20. May be repeated.",
        ),
    ] = None,
    overrides: SetOption = None,
    in_process: Annotated[
        bool,
        typer.Option("--in-process", help="No kinds that need processes: they are refused."),
    ] = False,
    allow: Annotated[
        str,
        typer.Option(
            metavar="VERDICT,VERDICT",
            help="Exit with 0 if no cell is anything but these: held and recovered always, stopped,"
            " failed, diverged, refused, error.",
        ),
    ] = "stopped,refused",
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Cells at a time. Default: as many as processors."),
    ] = None,
    limit: Annotated[
        float, typer.Option(metavar="SECONDS", help="Longest wall time of a cell.")
    ] = _LIMIT_S,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the campaign, new or empty. Default: runs/<time>-<scenario>-faults.",
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Go on with the campaign of this folder; with --jobs, --allow, --junit, --json.",
        ),
    ] = None,
    junit: JunitOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print campaign.json on standard output, no matrix.")
    ] = False,
    json_lines: JsonLinesOption = False,
) -> None:
    """Faults by times by seeds: what a scenario survives, as a matrix of verdicts."""
    from fleetloop.campaign import command, plan
    from fleetloop.campaign.matrix import Conditions
    from fleetloop.campaign.verdicts import verdicts_named

    refuse_both(as_json, json_lines)
    ways = command.Ways(jobs, as_json, junit, verdicts_named(allow), json_lines)
    if resume is not None:
        if scenario is not None:
            raise ScenarioError(f"{scenario}: --resume {resume} has its scenario in its folder")
        raise typer.Exit(command.resume(resume, ways))
    if scenario is None:
        raise ScenarioError("name a scenario, or --resume FOLDER")
    for name, value in (("--for", lasting), ("--limit", limit), ("--hold", hold)):
        if not 0 < value <= numbers.LONGEST_S:
            raise ScenarioError(
                f"{name} {value:g}: must be above 0 and at most {numbers.LONGEST_S:g}"
            )
    if not 0 <= recover_within <= numbers.LONGEST_S:
        raise ScenarioError(f"--recover-within {recover_within:g}: must be 0 or more")
    from configs.loading import load

    given = tuple(overrides or ())
    loaded = load(scenario, given)
    kinds = plan.kinds_named(faults)
    found = plan.Plan(
        scenario,
        given,
        kinds,
        plan.times_named(at if at is not None else f"{0.5 * loaded.duration_s:g}", loaded),
        plan.seeds_named(seeds, loaded.seed),
        Conditions(
            plan.robots_named(listed("--robots", robots), loaded),
            lasting,
            recover_within,
            hold,
            plan.parameters_named(param or (), kinds),
        ),
        in_process,
        limit,
    )
    raise typer.Exit(command.begin(found, loaded, out, ways))
