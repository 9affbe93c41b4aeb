"""tune.html: baseline and best, figures, all trials, on one page that needs nothing else."""

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from importlib import resources
from string import Template

from fleetloop.results import pages
from fleetloop.results.drawing import WIDTH_IN
from fleetloop.results.figures import Captioned
from fleetloop.results.pages import figure_tag, table_tag
from fleetloop.tune import tables
from fleetloop.tune.scores import Trial
from fleetloop.tune.tables import Judged, shown
from fleetloop.tune.tuning import Tuning


def page(
    tuning: Tuning,
    trials: Sequence[Trial],
    judged: Sequence[Judged],
    said: Sequence[str],
    best: str,
    figures: Iterable[tuple[Captioned, bytes]],
) -> str:
    """The page as HTML.

    Args:
        tuning: what was asked.
        trials: all that are done.
        judged: baseline and best.
        said: what it came to, in sentences.
        best: the text of best.toml, or why there is none.
        figures: with their PNG files.
    """
    template = Template(resources.files("fleetloop.tune").joinpath("page.html").read_text("utf-8"))
    body = template.substitute(
        verdict="".join(f"<p>{escape(text)}</p>" for text in said),
        table=table_tag(tables.header(judged), tables.rows(tuning, judged)),
        notes=escape(
            "All trials are judged over the same cases. Other cases: of the same design, with"
            " another seed; no trial was chosen by them."
        ),
        best=escape(best),
        figures="\n".join(
            figure_tag(item.caption, data, narrow=item.figure.get_figwidth() <= WIDTH_IN)
            for item, data in figures
        ),
        trials=table_tag(_header(tuning), _rows(tuning, trials)),
        tuning=escape(tuning.to_toml()),
    )
    return pages.page(f"Fleetloop: {tuning.title}", tuning.description, body)


def _header(tuning: Tuning) -> list[str]:
    names = [one.column for one in tuning.parameter]
    return ["trial", *names, tuning.objective.label, *(one.label for one in tuning.demands)]


def _rows(tuning: Tuning, trials: Sequence[Trial]) -> Iterator[list[str]]:
    for trial in trials:
        score = trial.score
        numbers = [score.constraints[one.label] for one in tuning.demands]
        values = [trial.values[one.column] for one in tuning.parameter]
        yield [str(trial.number), *map(shown, (*values, score.objective, *numbers))]
