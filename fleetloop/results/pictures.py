"""A figure as the bytes of a file; equal figures make equal files."""

from io import BytesIO

from matplotlib.figure import Figure

_NAMELESS: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""No software name or date in a file."""


def picture(figure: Figure, form: str) -> bytes:
    """A figure as a file: png, svg or pdf."""
    buffer = BytesIO()
    figure.savefig(buffer, format=form, metadata=_NAMELESS[form])
    return buffer.getvalue()


def png(figure: Figure) -> bytes:
    """A figure as a PNG file."""
    return picture(figure, "png")


def lay_out(figure: Figure) -> None:
    """Compute the layout, once for all formats."""
    if figure.get_layout_engine() is not None:
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
