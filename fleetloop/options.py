"""Arguments and options that verbs share, and their overrides of a scenario."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from configs.errors import ScenarioError
from fleetloop.numbers import RunFirst

if TYPE_CHECKING:
    from configs.overrides import Overrides


def _shipped(incomplete: str) -> list[str]:
    """Completions: names of shipped scenarios with this prefix; the shell completes file names."""
    from configs.loading import shipped

    return [name for name in shipped() if name.startswith(incomplete)]


def _print_version(wanted: bool) -> None:
    if not wanted:
        return
    import platform
    from importlib.metadata import version

    others = ", ".join(f"{name} {version(name)}" for name in ("eclipse-zenoh", "python-can"))
    typer.echo(f"fleetloop {version('fleetloop')} (Python {platform.python_version()}, {others})")
    raise typer.Exit


ScenarioArg = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="A scenario file, or the name of a shipped one (fleetloop check lists them).",
        autocompletion=_shipped,
    ),
]
ClockOption = Annotated[
    str | None,
    typer.Option(
        metavar="lockstep|realtime",
        help="Override clock.mode: lockstep runs fast and repeats bit for bit, realtime keeps the"
        " wall clock.",
    ),
]
SeedOption = Annotated[int | None, typer.Option(metavar="N", help="Override the seed.")]
RunArg = Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or its record.mcap.")]
GoingOnArg = Annotated[
    str,
    typer.Argument(
        metavar="RUN",
        help="Name or folder of a run that goes on on this machine; none: the only one.",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Also while another client, as a page, has the controls.")
]
PartialOption = Annotated[
    bool,
    typer.Option(
        "--partial",
        help="Read a cut or damaged record up to its first gap, with exit status 0. Default: refuse"
        " it, with 1 if it is cut, 2 if it is damaged.",
    ),
]
ToleranceOption = Annotated[
    list[str] | None,
    typer.Option(
        "--tolerance",
        metavar="NUMBER|SIGNAL=NUMBER",
        help="Values this close are alike, in the signal's unit. May be repeated; that of a signal"
        " goes before that of all. Default: bit for bit.",
    ),
]
ByOption = Annotated[
    str,
    typer.Option(
        "--by",
        metavar="first|size",
        help="Rank signals by their first difference, or by the size of the largest, measured by"
        " the signal's peak.",
    ),
]
AllOption = Annotated[bool, typer.Option("--all", help="Show every signal that differs.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the scenario, e.g. --set coordination.p=3"
        " --set robot.r2.pose.x_m=-6.5 . May be repeated.",
    ),
]
DeploymentOption = Annotated[
    Path | None,
    typer.Option(
        "--deployment",
        metavar="FILE",
        help="CAN interfaces, router and roles on other machines. Default: all on this machine.",
    ),
]
JsonLinesOption = Annotated[
    bool,
    typer.Option(
        "--json-lines",
        help="Print what happens as it does, an object of JSON per line; the last one has the"
        " outcome.",
    ),
]
JunitOption = Annotated[
    Path | None,
    typer.Option("--junit", metavar="FILE", help="Write the verdicts as JUnit XML, for CI."),
]
VersionOption = Annotated[
    bool,
    typer.Option(
        "--version", callback=_print_version, is_eager=True, help="Print versions and end."
    ),
]


def verbs_of_run(about: str) -> typer.Typer:
    """Verbs before which a run that goes on may be named; their context has it as its object."""
    app = typer.Typer(
        cls=RunFirst,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        rich_markup_mode="rich",
    )

    @app.callback(help=about)
    def of_run(ctx: typer.Context, run: GoingOnArg = "") -> None:
        ctx.obj = run

    return app


def listed(option: str, text: str | None) -> tuple[str, ...]:
    """Split a comma-separated list of names; empty if the option is absent."""
    names = tuple(filter(None, map(str.strip, (text or "").split(","))))
    if text is not None and not names:
        raise ScenarioError(f"{option} {text!r}: names nothing; leave it out for all")
    return names


def size_first(by: str) -> bool:
    """Whether `--by` ranks by size."""
    if by not in ("first", "size"):
        raise ScenarioError(f"--by {by}: must be first or size")
    return by == "size"


def overrides_of(
    overrides: list[str] | None,
    *,
    clock: str | None = None,
    seed: int | None = None,
    duration: float | None = None,
    record_inputs: bool = False,
) -> "Overrides":
    """Overrides from the options; errors in them name the option."""
    from configs.overrides import Override

    said = (
        ("--clock", "clock.mode", clock),
        ("--duration", "until_s", duration),
        ("--seed", "seed", seed),
    )
    named = [
        Override(f"{flag} {value:g}" if isinstance(value, float) else f"{flag} {value}", key, value)
        for flag, key, value in said
        if value is not None
    ]
    if record_inputs:
        named.append(Override("--record-inputs", "record.inputs", True))
    return (*(overrides or ()), *named)


def refuse_both(as_json: bool, json_lines: bool) -> None:
    """Refuse one document and lines at once."""
    if as_json and json_lines:
        raise ScenarioError("--json and --json-lines: choose one")


def refuse_lockstep(clock: str | None) -> None:
    """Refuse lockstep for a role that runs without its launcher."""
    if clock not in (None, "realtime"):
        raise ScenarioError(
            f"--clock {clock}: what runs on its own keeps the wall clock; it must be realtime"
        )
