"""The command line: `fleetloop VERB ...`. Arguments only; each verb's work is in its own module.

Exit status: 0 held, 1 an expectation failed or was not reached, two runs differ or a record is cut,
2 usage or scenario, 3 infrastructure (named), 130 interrupted (`configs.errors.ExitStatus`).
"""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from configs.errors import ExitStatus, FleetloopError
from fleetloop import numbers
from fleetloop.can.app import app as can_app
from fleetloop.certificates.app import app as certs_app
from fleetloop.options import (
    ClockOption,
    DeploymentOption,
    PartialOption,
    RunArg,
    ScenarioArg,
    SeedOption,
    SetOption,
    VersionOption,
    listed,
    overrides_of,
    refuse_lockstep,
)

app = typer.Typer(
    name="fleetloop",
    cls=numbers.OurWords,
    help="Run cooperating differential-drive robots in emulation: one controller process per robot,"
    " Zenoh between them, a python-can bus to emulated drives.",
    epilog="Start with: fleetloop run paper",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.add_typer(can_app, name="can")
app.add_typer(certs_app, name="certs")


@app.command()
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
        bool, typer.Option("--json", help="Print summary.json on standard output, no table.")
    ] = False,
    profile: Annotated[
        bool,
        typer.Option(
            "--profile", help="Sample and print the processor time of each part of a tick."
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
    from fleetloop.launch.run import RunOptions, run_scenario

    options = RunOptions(
        in_process=in_process,
        speed=speed,
        overrides=overrides_of(overrides, clock=clock, seed=seed, duration=duration),
        out=out,
        as_json=as_json,
        figures=figures,
        profile=profile,
        deployment=deployment,
        allow_unchecked=allow_unchecked,
        force=force,
    )
    raise typer.Exit(run_scenario(scenario, options))


@app.command()
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


@app.command()
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
    options = PlantOptions(
        robots=listed("--robots", robots),
        duration_s=duration,
        deployment=deployment,
        overrides=overrides_of(overrides, clock=clock, seed=seed),
        as_json=as_json,
        serve_stdin=stdin,
        join=join,
    )
    raise typer.Exit(run_plant(scenario, options))


@app.command()
def check(
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENARIO]",
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


@app.command()
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


@app.command()
def graph(
    scenario: ScenarioArg,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the graph as well: .graphml (yEd, NetworkX), .dot (Graphviz), or a picture,"
            " .svg, .png, .pdf.",
        ),
    ] = None,
    seed: SeedOption = None,
    overrides: SetOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the graph as JSON.")] = False,
) -> None:
    """Show the directed graph: adjacency, leader links, roots, in-degrees, inequality (46)."""
    from fleetloop.graph.command import show_graph

    show_graph(scenario, overrides_of(overrides, seed=seed), out=out, as_json=as_json)


@app.command()
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


@app.command()
def report(run: RunArg, partial: PartialOption = False) -> None:
    """Rebuild report.html and the figures of a run from its record."""
    from fleetloop.results.report import write_report
    from fleetloop.results.run_folder import read_record
    from fleetloop.results.tables import print_report

    print_report(write_report(run, read_record(run, partial=partial)))


@app.command()
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


@app.command()
def diff(
    a: Annotated[Path, typer.Argument(metavar="A", help="A run's folder, or its record.mcap.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The other run.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    partial: PartialOption = False,
) -> None:
    """Compare two runs bit for bit; name the first tick, robot and field that differ."""
    from fleetloop.results.diff import print_comparison

    raise typer.Exit(print_comparison(a, b, as_json=as_json, partial=partial))


@app.command()
def init(
    file: Annotated[
        Path, typer.Argument(metavar="FILE.toml", help="The scenario file to write.")
    ] = Path("scenario.toml"),
) -> None:
    """Write a commented starter scenario."""
    from fleetloop.init import write_starter

    write_starter(file)


@app.callback()
def _common(version: VersionOption = False) -> None:
    pass


def main() -> None:
    """Run the command line; an error that a user can cause is one line and an exit status."""
    status: str | int | None = ExitStatus.OK
    try:
        app()
    except SystemExit as ended:
        status = ended.code
    except FleetloopError as error:
        sys.stderr.write(f"fleetloop: {error}\n")
        status = int(error.exit_status)
    link = sys.modules.get("bridge.network.zenoh_link")
    if link is not None and link.ZenohLink.stuck:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status if isinstance(status, int) else ExitStatus.FAILED)
    sys.exit(status)
