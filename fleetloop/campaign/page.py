"""campaign.html: the matrix, each cell with its details, on one page that needs nothing else."""

from collections.abc import Iterator, Sequence
from html import escape
from importlib import resources
from string import Template

from configs.loading import to_toml
from configs.scenario import Scenario
from fleetloop.campaign.folder import Folder
from fleetloop.campaign.tables import (
    LETTERS,
    by_kind_and_time,
    notes,
    summary_line,
    text_of,
    title,
    worst,
)
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.results import pages

_MEANINGS = {
    Verdict.HELD: "held: never out of bounds",
    Verdict.RECOVERED: "recovered: back in bounds so many seconds after the fault's begin",
    Verdict.STOPPED: "stopped: a robot stopped itself",
    Verdict.FAILED: "failed: still out of bounds",
    Verdict.DIVERGED: "diverged: a body's motion left all bounds",
    Verdict.ERROR: "error: no result",
    Verdict.REFUSED: "refused: can't act here",
}


def page(folder: Folder, scenario: Scenario, results: Sequence[Result], wall_s: float) -> str:
    """The page as HTML."""
    room = resources.files("fleetloop.campaign")
    grid = by_kind_and_time(results)
    times_s = folder.plan.times_s
    head = "".join(f'<th scope="col">{at_s:g} s</th>' for at_s in times_s)
    body, details = [], []
    for kind, by_time in grid.items():
        row = "".join(_cell(by_time.get(at_s, [])) for at_s in times_s)
        body.append(f'<tr><th scope="row">{escape(kind)}</th>{row}</tr>')
        details += [_details(found) for found in by_time.values()]
    legend = "".join(
        f'<li><b class="{verdict}">{escape(LETTERS[verdict])}</b> {escape(meaning)}</li>'
        for verdict, meaning in _MEANINGS.items()
    )
    shown = Template(room.joinpath("page.html").read_text("utf-8")).substitute(
        summary=escape(summary_line(results, wall_s)),
        head=head,
        body="".join(body),
        legend=legend,
        notes="".join(f'<p class="note">{escape(line)}</p>' for line in notes(folder, results)),
        details="".join(details),
        scenario=escape(to_toml(scenario)),
    )
    style = room.joinpath("page.css").read_text("utf-8")
    return pages.page(
        f"Fleetloop: {title(folder, scenario)}", scenario.description, shown, style=style
    )


def _id(result: Result) -> str:
    return f"{result.cell.kind}-{result.cell.at_s:g}".replace(".", "_")


def _cell(found: Sequence[Result]) -> str:
    if not found:
        return "<td></td>"
    one = worst(found)
    label = f"{one.cell.kind} at {one.cell.at_s:g} s: {one.verdict}"
    return (
        f'<td class="{one.verdict}"><a href="#{_id(one)}" title="{escape(label)}">'
        f"{escape(text_of(one))}</a></td>"
    )


def _details(found: Sequence[Result]) -> str:
    """What is known of a cell, of each seed."""
    first = found[0]
    parts = "".join(
        (f"<h4>seed {one.cell.seed}</h4>" if len(found) > 1 else "") + "".join(_lines(one))
        for one in sorted(found, key=lambda one: one.cell.seed)
    )
    heading = f"{escape(first.cell.kind)} at {first.cell.at_s:g} s"
    return (
        f'<section class="detail" id="{_id(first)}"><a class="close" href="#matrix">close</a>'
        f"<h3>{heading}</h3>{parts}</section>"
    )


def _lines(one: Result) -> Iterator[str]:
    reason = f": {one.reason}" if one.reason else ""
    yield f'<p><b class="{one.verdict}">{one.verdict}</b>{escape(reason)}</p>'
    facts = []
    if one.settle_s is not None:
        facts.append(f"in bounds again {one.settle_s:.3f} s after the fault's begin")
    if one.peak_m is not None:
        peak = f"greatest position error from then on {1e3 * one.peak_m:.3g} mm"
        facts.append(f"{peak}, of {one.peak_robot} at {one.peak_at_s:g} s")
    if facts:
        yield f"<p>{escape('; '.join(facts))}</p>"
    if one.notices:
        yield f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in one.notices)}</ul>"
    if one.command:
        yield f"<pre>{escape(one.command)}</pre>"
