"""The verb `tune`: arguments only, the work is in other modules."""

from pathlib import Path
from typing import Annotated

import typer

from configs.errors import ScenarioError
from fleetloop.sweep.options import (
    ReferenceOption,
    SchedulerOption,
    TlsCaOption,
    TlsCertOption,
    TlsKeyOption,
    Ways,
    place_of,
)


def _shipped(incomplete: str) -> list[str]:
    from fleetloop.tune.tuning import shipped

    return [name for name in shipped() if name.startswith(incomplete)]


def tune(
    study: Annotated[
        str | None,
        typer.Argument(
            metavar="STUDY",
            help="A tuning file, or the name of a shipped one: robust_gains_100hz.",
            autocompletion=_shipped,
        ),
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(metavar="N", help="Number of trials, instead of the file's."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(metavar="N", help="Seed of cases and sampler, instead of the file's."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the tuning, new or empty. Default: runs/<time>-<study>-tune.",
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Go on with the tuning of this folder, as if it had never ended; with --trials"
            " further than it was begun for. STUDY may be left out; another one is refused.",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1024,
            help="Processes that share the cases of a trial; their number changes no result."
            " Default: as many as processors.",
        ),
    ] = None,
    scheduler: SchedulerOption = None,
    tls_ca: TlsCaOption = None,
    tls_cert: TlsCertOption = None,
    tls_key: TlsKeyOption = None,
    in_process: ReferenceOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print tune.json on standard output, no table.")
    ] = False,
) -> None:
    """Search for gains that suit many cases, by Optuna: objective, constraints, a baseline."""
    from fleetloop.tune import command

    place = place_of(jobs, scheduler, (tls_ca, tls_cert, tls_key), option="--jobs")
    ways = Ways(place, kernel=not in_process, as_json=as_json)
    if resume is not None:
        if out is not None:
            raise ScenarioError(f"--resume {resume} has its folder: leave out --out")
        raise typer.Exit(command.resume(resume, study, trials, seed, ways))
    if study is None:
        raise ScenarioError("name a tuning file, or --resume FOLDER")
    raise typer.Exit(command.begin(study, trials, seed, out, ways))
