"""The verb `check`: arguments only, the work is in other modules."""

from typing import Annotated

import typer

from fleetloop.options import ClockOption, DeploymentOption, SeedOption, SetOption, overrides_of


def check(
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENARIO",
            help="A scenario file or the name of a shipped one. Default: list the shipped ones.",
        ),
    ] = None,
    clock: ClockOption = None,
    seed: SeedOption = None,
    overrides: SetOption = None,
    deployment: DeploymentOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of scenario files, for editors.")
    ] = False,
) -> None:
    """Check a scenario without running it: schema, graph conditions, stability, gains, torque."""
    from fleetloop.check.command import check_scenario, list_scenarios, print_schema

    if schema:
        print_schema()
    elif scenario is None:
        list_scenarios(as_json=as_json)
    else:
        changes = overrides_of(overrides, clock=clock, seed=seed)
        raise typer.Exit(check_scenario(scenario, changes, deployment=deployment, as_json=as_json))
