"""`fleetloop sweep report FOLDER`: a study's dataset as a page, figures and tables.

<folder>/report.html     needs nothing beside it, and no network
<folder>/figures/*       as PNG, SVG and PDF, with captions
"""

from pathlib import Path

from fleetloop.results import run_folder
from fleetloop.results.figures import Captioned
from fleetloop.results.publication import write_figures
from fleetloop.results.summary import finite
from fleetloop.sweep.report.derived import with_derived
from fleetloop.sweep.report.figures import (
    THEORY_MAP,
    growth,
    heat_map,
    main_effects,
    synchronisation,
)
from fleetloop.sweep.report.page import PAGE, page
from fleetloop.sweep.report.parallel import parallel_coordinates
from fleetloop.sweep.report.results import RATES, results_of
from fleetloop.sweep.report.tables import print_view, remarks
from fleetloop.sweep.report.view import Choice, View, numbers_of, view_of
from fleetloop.terminal import note, say, say_json


def write_report(folder: Path, choice: Choice, *, as_json: bool = False) -> None:
    """Make the page and the figures of a study; print its numbers.

    Raises:
        ScenarioError: no study there, no rows, or a column isn't there.
        InfrastructureError: nothing can be read, or a file can't be written.
    """
    view = view_of(with_derived(results_of(folder)), choice)
    for line in remarks(view):
        note(line)
    figures = write_figures(folder, figures_of(view))
    target = folder / PAGE
    run_folder.write(target, page(view, figures))
    if as_json:
        say_json(finite(numbers_of(view)) | {"page": str(target)})
        return
    print_view(view)
    say(f"report   {target}\nfigures  {folder / 'figures'}")


def figures_of(view: View) -> list[Captioned]:
    """Every figure that there is something to draw for."""
    results, found = view.results, []
    if view.heat is not None:
        found.append(heat_map(view.heat, view.found))
        found += [heat_map(heat, lines, THEORY_MAP) for heat, lines in view.more]
    effects = [one for one in view.effects if one.bins]
    if effects:
        found.append(main_effects(effects, results.confidence))
    last = results.quantities[-1] if view.result.name in RATES else view.result
    more = (
        synchronisation(results),
        growth(results),
        parallel_coordinates(results, view.factors, last),
    )
    return found + [one for one in more if one is not None]
