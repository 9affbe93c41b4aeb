"""The verb `sweep`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated, Any

import typer

from configs.errors import ScenarioError
from fleetloop.numbers import OurWords
from fleetloop.sweep.options import (
    ReferenceOption,
    SchedulerOption,
    TlsCaOption,
    TlsCertOption,
    TlsKeyOption,
    Ways,
    place_of,
)
from fleetloop.sweep.report.app import report

_RUN = "run"


class StudyFirst(OurWords):
    """`sweep STUDY` is `sweep run STUDY`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """What isn't a verb of its own is a study, or an option of its run."""
        if args and args[0] not in (*self.commands, *ctx.help_option_names):
            args = [_RUN, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=StudyFirst,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="rich",
)


@app.callback()
def sweep() -> None:
    """One scenario in thousands of cases: sweeps and Monte Carlo, on this machine or a cluster.

    fleetloop sweep STUDY.toml is fleetloop sweep run STUDY.toml; fleetloop sweep run --help lists
    its options.
    """


def _shipped(incomplete: str) -> list[str]:
    from fleetloop.sweep.study import shipped

    return [name for name in shipped() if name.startswith(incomplete)]


@app.command()
def run(
    study: Annotated[
        str | None,
        typer.Argument(
            metavar="STUDY",
            help="A study file, or the name of a shipped one: delay_loss, mass_friction,"
            " stability_map, start_basin.",
            autocompletion=_shipped,
        ),
    ] = None,
    cases: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Number of cases, instead of the study's. Of a grid the first N; with --resume"
            " more of a random or Sobol' design.",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(metavar="N", help="Seed of the samples, instead of the study's.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the study, new or empty. Default: runs/<time>-<study>-sweep.",
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Go on with the study of this folder; no case is computed twice."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Processes here. Default: as many as processors."),
    ] = None,
    memory: Annotated[
        str,
        typer.Option(
            metavar="SIZE",
            help="Most memory of each of them, as 2GiB; one that takes more is ended, and its"
            " cases are computed again. Default: an equal share of the machine's.",
        ),
    ] = "auto",
    scheduler: SchedulerOption = None,
    tls_ca: TlsCaOption = None,
    tls_cert: TlsCertOption = None,
    tls_key: TlsKeyOption = None,
    in_process: ReferenceOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print sweep.json on standard output.")
    ] = False,
) -> None:
    """Compute the cases of a study: a row of results each, in a dataset of Parquet files."""
    from fleetloop.sweep import command

    tls = (tls_ca, tls_cert, tls_key)
    place = place_of(workers, scheduler, tls, option="--workers", memory=memory)
    ways = Ways(place, kernel=not in_process, as_json=as_json)
    if resume is not None:
        if study is not None or out is not None:
            raise ScenarioError(f"--resume {resume} has its study and its folder: name neither")
        raise typer.Exit(command.resume(resume, cases, seed, ways))
    if study is None:
        raise ScenarioError("name a study, or --resume FOLDER")
    raise typer.Exit(command.begin(study, cases, seed, out, ways))


@app.command()
def schema() -> None:
    """Print the JSON Schema of study files, for editors."""
    from fleetloop.sweep.study import json_schema
    from fleetloop.terminal import say_json

    say_json(json_schema())


app.command()(report)
