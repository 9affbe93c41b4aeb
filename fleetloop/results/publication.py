"""The figures of a run as files for papers: PNG, SVG and PDF in column width, and captions.

Text in SVG and PDF is text, its font embedded in PDF.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import numpy as np

from configs.errors import InfrastructureError
from fleetloop.results import run_folder
from fleetloop.results.drawing import STYLE
from fleetloop.results.figures import Captioned
from fleetloop.results.pictures import lay_out, png
from fleetloop.results.printer import Printer

FIGURES, CAPTIONS = "figures", "captions.md"
Drawn = tuple[Captioned, bytes]
"""A figure and its PNG file."""


def write_figures(run: Path, figures: Iterable[Captioned]) -> list[Drawn]:
    """Write figures into a run's folder of them, with their captions; return each with its PNG.

    Raises:
        InfrastructureError: one can't be written.
    """
    with figures_written(run, figures) as drawn:
        return drawn


@contextmanager
def figures_written(run: Path, figures: Iterable[Captioned]) -> Iterator[list[Drawn]]:
    """The same, the PNG files at once: the others are there when this context ends.

    Raises:
        InfrastructureError: one can't be written.
    """
    folder = run / FIGURES
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't make {folder}: {error.strerror or error}") from error
    drawn = []
    with Printer(folder) as printer:
        with mpl.rc_context(STYLE), np.errstate(all="ignore"):
            for item in figures:
                lay_out(item.figure)
                printer.print(item.name, item.figure)
                data = png(item.figure)
                run_folder.write(folder / f"{item.name}.png", data)
                drawn.append((item, data))
        captions = [f"* `{item.name}`: {item.caption}" for item, _ in drawn]
        run_folder.write(folder / CAPTIONS, "\n".join(["# Figures", "", *captions, ""]))
        yield drawn
