"""The report's figures of a run, one at a time; they show themselves in a notebook."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from configs.errors import ScenarioError
from configs.scenario import Scenario
from fleetloop.record.reader import Record
from fleetloop.results import figures
from fleetloop.results.drawing import STYLE
from fleetloop.results.pictures import png
from fleetloop.results.summary import Summary

_FIGURES: Mapping[str, figures.Draw] = {
    "graph": figures.graph,
    "positions": figures.positions,
    "path_variables": figures.path_variables,
    "parameter_errors": figures.parameter_errors,
    "speed_estimates": figures.speed_estimates,
    "torques": figures.torques,
    "law_signals": figures.law_signals,
    **figures.ERRORS,
}


def draw(name: str, record: Record, scenario: Scenario) -> Figure:
    """One figure.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in _FIGURES:
        raise ScenarioError(f"signal = {name!r}: one of {', '.join(figures.ERRORS)}")
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        return _shows_itself(_FIGURES[name](record, scenario))


def all_of(record: Record, scenario: Scenario, summary: Summary) -> Mapping[str, Figure]:
    """Every figure of the report, by name."""
    made = figures.all_figures(record, scenario, summary)
    return {one.name: _shows_itself(one.figure) for one in made}


def _shows_itself(figure: Figure) -> Figure:
    """Notebooks ask an object for a picture; a figure that isn't pyplot's has none of its own."""
    shown: Any = figure
    shown._repr_png_ = partial(png, figure)
    return figure
