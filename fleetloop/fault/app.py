"""The command line of `fleetloop fault [RUN] VERB ...`: arguments only."""

from typing import Annotated, Any

import typer

from fleetloop.numbers import LONGEST_S, above_zero, between
from fleetloop.options import ForceOption, JsonOption, listed, verbs_of_run

app = verbs_of_run(
    "Faults of a run while it goes on: list, inject and clear them; the kinds there are."
)


@app.command("list")
def list_(
    ctx: typer.Context,
    as_toml: Annotated[
        bool,
        typer.Option("--toml", help=r"Print the entries of \[\[fault]] that repeat them."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """List all faults of a run: of its scenario and ordered ones, with their state."""
    from fleetloop.fault.command import list_faults

    list_faults(ctx.obj, as_json=as_json, as_toml=as_toml)


@app.command()
def inject(
    ctx: typer.Context,
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="A kind of fault (fleetloop fault kinds).")
    ],
    robots: Annotated[
        str | None,
        typer.Option("--robot", metavar="R1,R2", help="Only these robots. Default: all."),
    ] = None,
    edges: Annotated[
        list[str] | None,
        typer.Option(
            "--edge", metavar="'R1 -> R2'", help="Only this edge, of links. May be repeated."
        ),
    ] = None,
    wheel: Annotated[
        str | None, typer.Option(metavar="right|left|both", help="Behind this wheel.")
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="A parameter of the kind. May be repeated."
        ),
    ] = None,
    for_s: Annotated[
        float | None,
        typer.Option(
            "--for",
            callback=above_zero(LONGEST_S),
            metavar="SECONDS",
            help="So long, in scenario time. Default: until it is cleared.",
        ),
    ] = None,
    at_s: Annotated[
        float | None,
        typer.Option(
            "--at",
            callback=between(0.0, LONGEST_S),
            metavar="SECONDS",
            help="From this scenario time on. Default: now.",
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(metavar="NAME", help="To clear it by. Default: KIND, KIND_2, ...")
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Apply a fault; say from which tick on it acts."""
    from fleetloop.fault.command import inject_fault

    given: dict[str, Any] = {
        "kind": kind,
        "robots": listed("--robot", robots) or None,
        "edges": edges or None,
        "wheel": wheel,
        "for_s": for_s,
        "at_s": at_s,
        "name": name,
    }
    table = {key: value for key, value in given.items() if value is not None}
    inject_fault(ctx.obj, table, parameters or [], as_json=as_json, force=force)


@app.command()
def clear(
    ctx: typer.Context,
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME...", help="Names of faults.")
    ] = None,
    all_: Annotated[bool, typer.Option("--all", help="All that act, or are planned.")] = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """End faults before their time; say at which tick they do."""
    from fleetloop.fault.command import clear_faults

    if bool(names) is all_:
        raise typer.BadParameter("name faults, or --all.")
    clear_faults(ctx.obj, names or [], as_json=as_json, force=force)


@app.command()
def kinds(
    kind: Annotated[
        str | None, typer.Argument(metavar="KIND", help="Its parameters. Default: all kinds.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """List the kinds of faults; of one its parameters with units, bounds and defaults."""
    from fleetloop.fault.kinds import print_kinds

    print_kinds(kind, as_json=as_json)
