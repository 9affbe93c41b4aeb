"""The figures of a run as files for papers: PNG, SVG and PDF in column width, and captions.

Text in SVG and PDF is text, its font embedded in PDF.
"""

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from configs.errors import InfrastructureError
from fleetloop.results import run_folder
from fleetloop.results.drawing import STYLE
from fleetloop.results.figures import Captioned

FIGURES, CAPTIONS = "figures", "captions.md"
FORMATS = ("png", "svg", "pdf")
_NAMELESS: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""No software name or date in a file."""
Drawn = tuple[Captioned, bytes]
"""A figure and its PNG file."""


def write_figures(run: Path, figures: Iterable[Captioned]) -> list[Drawn]:
    """Write figures into a run's folder of them, with their captions; return each with its PNG.

    Raises:
        InfrastructureError: one can't be written.
    """
    folder = run / FIGURES
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't make {folder}: {error.strerror or error}") from error
    drawn = []
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        for item in figures:
            lay_out(item.figure)
            for form in FORMATS:
                data = picture(item.figure, form)
                run_folder.write(folder / f"{item.name}.{form}", data)
                if form == "png":
                    drawn.append((item, data))
    captions = [f"* `{item.name}`: {item.caption}" for item, _ in drawn]
    run_folder.write(folder / CAPTIONS, "\n".join(["# Figures", "", *captions, ""]))
    return drawn


def lay_out(figure: Figure) -> None:
    """Compute the layout, once for all formats."""
    if figure.get_layout_engine() is not None:
        figure.draw_without_rendering()
        figure.set_layout_engine("none")


def picture(figure: Figure, form: str) -> bytes:
    """A figure as a file of one of `FORMATS`; equal figures make equal files."""
    buffer = BytesIO()
    figure.savefig(buffer, format=form, metadata=_NAMELESS[form])
    return buffer.getvalue()


def png(figure: Figure) -> bytes:
    """A figure as a PNG file."""
    return picture(figure, "png")
