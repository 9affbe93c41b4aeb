"""The figures of a run as files, for papers."""

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from configs.errors import InfrastructureError
from fleetloop.results import run_folder
from fleetloop.results.figures import Captioned

FIGURES = "figures"
Drawn = tuple[Captioned, bytes]
"""A figure and its PNG file."""


def write_figures(run: Path, figures: Iterable[Captioned]) -> list[Drawn]:
    """Write figures into a run's folder of them; return each with its PNG file.

    Raises:
        InfrastructureError: one can't be written.
    """
    drawn = [(item, png(item.figure)) for item in figures]
    folder = run / FIGURES
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't make {folder}: {error.strerror or error}") from error
    for item, data in drawn:
        run_folder.write(folder / f"{item.name}.png", data)
    return drawn


def png(figure: Figure) -> bytes:
    """A figure as a PNG file."""
    buffer = BytesIO()
    # No software name or date in the file: equal runs make equal figures.
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
