"""The verbs `run`, `agent`, `plant`, `network`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop import numbers
from fleetloop.options import (
    ClockOption,
    DeploymentOption,
    JsonLinesOption,
    JunitOption,
    ScenarioArg,
    SeedOption,
    SetOption,
    listed,
    overrides_of,
    refuse_both,
    refuse_lockstep,
)


def run(
    scenario: ScenarioArg,
    in_process: Annotated[
        bool,
        typer.Option(
            "--in-process",
            help="Reference run: all roles in this process, without network and buses. The record"
            " is the same, bit for bit.",
        ),
    ] = False,
    speed: Annotated[
        float,
        typer.Option(
            callback=numbers.speed,
            metavar="FACTOR",
            help="Hold the run to this multiple of real time; 0: as fast as the machine allows.",
        ),
    ] = 0.0,
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="With a page that shows the run and has its controls; its address is printed when"
            " it is there (fleetloop live opens it later).",
        ),
    ] = False,
    clock: ClockOption = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Scenario time at which the run ends."),
    ] = None,
    seed: SeedOption = None,
    overrides: SetOption = None,
    deployment: DeploymentOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the run, new or empty. Default: runs/<time>-<scenario>.",
        ),
    ] = None,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print the outcome as JSON on standard output, no table: summary.json and more,"
            " or the problems of the scenario.",
        ),
    ] = False,
    json_lines: JsonLinesOption = False,
    junit: JunitOption = None,
    profile: Annotated[
        bool,
        typer.Option(
            "--profile", help="Sample and print the processor time of each part of a tick."
        ),
    ] = False,
    record_inputs: Annotated[
        bool,
        typer.Option(
            "--record-inputs",
            help="Record all that reaches each controller, for fleetloop replay; in real time that"
            " is the default.",
        ),
    ] = False,
    figures: Annotated[
        bool, typer.Option("--report/--no-report", help="Make report.html and the figures.")
    ] = True,
    allow_unchecked: Annotated[
        bool,
        typer.Option(
            "--allow-unchecked",
            help="Exit with status 0 even if the run ended before the time of an expectation, for"
            " example with --duration.",
        ),
    ] = False,
    force: Annotated[
        bool,
        typer.Option("--force", help="Run despite errors that `fleetloop check` finds."),
    ] = False,
) -> None:
    """Run a scenario, record everything, check its expectations, print and save the results."""
    from fleetloop.launch.fork_server import imports_begun
    from fleetloop.signals import deferred

    refuse_both(as_json, json_lines)
    chosen = overrides_of(
        overrides, clock=clock, seed=seed, duration=duration, record_inputs=record_inputs
    )
    with imports_begun(wanted=not in_process) as fork_server:
        with deferred() as came:
            from fleetloop.launch.run import RunOptions, run_scenario

        options = RunOptions(
            in_process=in_process,
            speed=speed,
            live=live,
            overrides=chosen,
            out=out,
            as_json=as_json,
            json_lines=json_lines,
            figures=figures,
            profile=profile,
            deployment=deployment,
            allow_unchecked=allow_unchecked,
            force=force,
            junit=junit,
        )
        status = run_scenario(scenario, options, interrupted=bool(came), fork_server=fork_server)
    raise typer.Exit(status)


def agent(
    scenario: ScenarioArg,
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="Name of the robot in the scenario.")
    ],
    deployment: Annotated[
        Path,
        typer.Option("--deployment", metavar="FILE", help="CAN bus, router, credentials."),
    ],
    clock: ClockOption = None,
    seed: SeedOption = None,
    overrides: SetOption = None,
) -> None:
    """Run the controller of one robot alone, as on the robot: own CAN bus, remote router."""
    from fleetloop.launch.agent import run_agent

    refuse_lockstep(clock)
    changes = overrides_of(overrides, clock=clock, seed=seed)
    raise typer.Exit(run_agent(scenario, robot, deployment, changes))


def plant(
    scenario: ScenarioArg,
    robots: Annotated[
        str | None,
        typer.Option(metavar="R1,R2", help="Only these robots. Default: all emulated robots."),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            callback=numbers.between(0.0, numbers.LONGEST_S),
            metavar="SECONDS",
            help="End after this time. Default: run until Ctrl-C.",
        ),
    ] = None,
    clock: ClockOption = None,
    seed: SeedOption = None,
    overrides: SetOption = None,
    deployment: DeploymentOption = None,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="When ready, print the arguments of can.Bus(**...) on one line."
        ),
    ] = False,
    json_lines: JsonLinesOption = False,
    stdin: Annotated[
        bool,
        typer.Option(
            "--stdin", help="Answer requests for poses on standard input; end when it closes."
        ),
    ] = False,
    join: Annotated[
        bool,
        typer.Option("--join", help="Join the run of the deployment as its plant."),
    ] = False,
) -> None:
    """Emulate drives and physics alone, in real time, for your own CAN host code."""
    from fleetloop.launch.plant import PlantOptions, run_plant

    refuse_lockstep(clock)
    refuse_both(as_json, json_lines)
    options = PlantOptions(
        robots=listed("--robots", robots),
        duration_s=duration,
        deployment=deployment,
        overrides=overrides_of(overrides, clock=clock, seed=seed),
        as_json=as_json,
        json_lines=json_lines,
        serve_stdin=stdin,
        join=join,
    )
    raise typer.Exit(run_plant(scenario, options))


def network(
    scenario: ScenarioArg,
    deployment: Annotated[
        Path, typer.Argument(metavar="DEPLOYMENT", help="Its network.router is external.")
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE.json5", help="File to write; .users beside it.")
    ],
    router_config: Annotated[
        bool,
        typer.Option(
            "--router-config",
            help="Write the configuration of a router of its own: zenohd -c FILE.json5.",
        ),
    ] = False,
    clock: ClockOption = None,
    overrides: SetOption = None,
) -> None:
    """Write what the network of a run needs outside of it: the configuration of its router."""
    from fleetloop.launch.router_file import write_router_config

    if not router_config:
        raise typer.BadParameter("say what to write: --router-config")
    write_router_config(scenario, deployment, out, overrides_of(overrides, clock=clock))
