"""Recorded and replayed outputs of one robot over each other, a panel per signal."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from configs.errors import ScenarioError
from fleetloop.results import run_folder
from fleetloop.results.decimation import decimated
from fleetloop.results.divergence import Divergence, by_size
from fleetloop.results.drawing import COLOURS, DPI, PAGE_IN, STYLE

TORQUES = ("tau_right_wheel_N_m", "tau_left_wheel_N_m")
_PANEL_IN = 1.5
_PANELS = 6


def signals_of(
    asked: Sequence[str], recorded: np.ndarray, replayed: np.ndarray, found: Sequence[Divergence]
) -> Sequence[str]:
    """The signals to draw: those asked for, else the torques and what differs most.

    Raises:
        ScenarioError: a signal that neither has.
    """
    known = [*(recorded.dtype.names or ()), *(replayed.dtype.names or ())]
    if unknown := [name for name in asked if name not in known]:
        raise ScenarioError(
            f"--signals {','.join(unknown)}: no such signal; there are"
            f" {', '.join(dict.fromkeys(known))}"
        )
    ranked = (one.signal.name for one in by_size(found))
    return asked or list(dict.fromkeys((*TORQUES, *ranked)))[:_PANELS]


def write_figure(
    path: Path, signals: Sequence[str], recorded: np.ndarray, replayed: np.ndarray, robot: str
) -> None:
    """Draw signals of the same ticks into a file, of the format that its ending says.

    Raises:
        InfrastructureError: the file can't be written.
    """
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        figure = drawn(signals, recorded, replayed, robot)
        buffer = BytesIO()
        figure.savefig(buffer, format=path.suffix[1:])
    run_folder.write(path, buffer.getvalue())


def drawn(signals: Sequence[str], recorded: np.ndarray, replayed: np.ndarray, robot: str) -> Figure:
    """A panel per signal."""
    height_in = 0.7 + _PANEL_IN * len(signals)
    figure = Figure(figsize=(PAGE_IN, height_in), dpi=DPI, layout="constrained")
    panels = figure.subplots(len(signals), 1, sharex=True, squeeze=False)[:, 0]
    sources = (
        (recorded, "recorded", COLOURS[0], "-", 2.2),
        (replayed, "replayed", COLOURS[1], "--", 1.1),
    )
    for axes, name in zip(panels, signals, strict=True):
        for rows, label, colour, dash, width in sources:
            if name in (rows.dtype.names or ()):
                t, values = decimated(rows["t_s"], rows[name])
                axes.plot(t, values, dash, color=colour, linewidth=width, label=label)
        axes.set_ylabel(name, fontsize=7)
        axes.tick_params(labelsize=7)
    panels[-1].set_xlabel("t [s]")
    lines = {str(line.get_label()): line for axes in panels for line in axes.get_lines()}
    figure.legend(list(lines.values()), list(lines), loc="outside upper right", ncols=2)
    figure.suptitle(f"Controller of {robot} on its recorded inputs", fontsize=10, x=0.02, ha="left")
    return figure
