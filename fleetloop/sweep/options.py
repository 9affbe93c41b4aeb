"""Options of studies and tunings: where their cases are computed, and how."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from configs.errors import ScenarioError

if TYPE_CHECKING:
    from fleetloop.sweep.cluster import Place

TlsFiles = tuple[Path | None, Path | None, Path | None]
"""Certificate of an authority; a certificate and its key."""
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="A Dask scheduler of your own, as tcp://host:8786, instead of processes here.",
    ),
]
TlsCaOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Of that scheduler: certificate of its authority."),
]
TlsCertOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Certificate to show to it.")
]
TlsKeyOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Private key of that certificate.")
]
ReferenceOption = Annotated[
    bool,
    typer.Option("--in-process", help="No batch kernel: every case as fleetloop run --in-process."),
]


@dataclass(frozen=True, slots=True)
class Ways:
    """How a study or a tuning is carried out and told; none changes a result."""

    place: "Place"
    kernel: bool = True
    as_json: bool = False


def place_of(
    workers: int | None,
    scheduler: str | None,
    tls: TlsFiles,
    *,
    option: str,
    memory: str = "auto",
) -> "Place":
    """Where these options have cases computed.

    Args:
        workers: processes here; as many as processors if not given.
        scheduler: address of one elsewhere.
        tls: files of its certificates.
        option: that says how many processes there are here, for messages.
        memory: of each of these at most.

    Raises:
        ScenarioError: options that don't go together.
    """
    from fleetloop.jobs import pool
    from fleetloop.sweep.cluster import Place
    from fleetloop.sweep.scheduler import Tls

    files = Tls(*tls)
    if scheduler is None and files.files:
        raise ScenarioError(f"{', '.join(files.files)}: of a --scheduler; none is given")
    if scheduler is not None and (workers is not None or memory != "auto"):
        raise ScenarioError(f"--scheduler {scheduler}: has its workers; leave out {option}")
    return Place(workers or pool.processors(), memory, scheduler, files)
