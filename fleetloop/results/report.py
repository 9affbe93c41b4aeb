"""`fleetloop report`: one interactive page of a run, and figures for papers.

<run>/report.html: needs nothing beside it, and no network      <run>/figures/*
"""

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

from fleetloop.record.reader import Record
from fleetloop.results import run_folder
from fleetloop.results.drawing import WIDTH_IN
from fleetloop.results.figures import all_figures
from fleetloop.results.interactive import plots_of
from fleetloop.results.known import Known, known_of
from fleetloop.results.marks import state_of
from fleetloop.results.pages import figure_tag, list_tag, page, resource, table_tag
from fleetloop.results.palette import MARKS
from fleetloop.results.publication import Drawn, figures_written
from fleetloop.results.summary import Summary
from fleetloop.results.tables import (
    final_line,
    found_value,
    label,
    margin,
    mark,
    network_lines,
    realtime_lines,
    robot_header,
    robot_rows,
    spread_line,
    trouble_lines,
    worst_place,
)
from fleetloop.results.traffic import traffic_of
from fleetloop.results.view import View

PAGE = "report.html"
MOST_EVENTS = 200
"""Of a page; summary.json has all."""
_HELD = {False: "failed", None: "not reached", True: "held"}
"""Of expectations, in words, the gravest first."""


def write_report(run: Path, record: Record | None = None) -> Path:
    """Make the figures and the page of a run; return the page.

    Args:
        run: its folder, or the record file itself.
        record: the record, if it was read already.

    Raises:
        ScenarioError: no record there, or nothing in it.
        InfrastructureError: the page or a figure can't be written.
    """
    if record is None:
        record = Record.open(run_folder.record_of(run))
    known = known_of(record)
    folder = record.path.parent
    target = folder / PAGE
    with figures_written(folder, all_figures(*known)) as figures:
        run_folder.write(target, page_of(known, figures))
    return target


def page_of(known: Known, figures: Sequence[Drawn]) -> str:
    """The page of a run."""
    scenario = known.scenario
    plots = plots_of(View(*known, traffic_of(known.record.path.parent, scenario)))
    static = "\n".join(
        figure_tag(item.caption, data, across=item.figure.get_figwidth() > WIDTH_IN)
        for item, data in figures
    )
    above, below = words_of_run(known)
    body = "\n".join(
        (
            above,
            f'<div class="screen interactive">{plots.body}</div>',
            f'<div class="paper"><h2>Figures</h2><div class="figures">{static}</div></div>',
            "<noscript><style>.interactive { display: none; } .paper { display: block; }</style>"
            "</noscript>",
            below,
            plots.scripts,
        )
    )
    title = f"Fleetloop: {scenario.name}"
    return page(title, scenario.description, body, style=resource("report.css"), head=plots.head)


def words_of_run(known: Known) -> tuple[str, str]:
    """What stands above the plots and below them."""
    return _results(known), "\n".join(_rest(known))


def _results(known: Known) -> str:
    """The verdict, and why; the table of the robots."""
    record, _, summary = known
    verdict, reason = summary["verdict"], summary["reason"]
    lost = f"The record isn't all there: {record.shortage()}." if record.lost else ""
    troubles = list_tag(trouble_lines(summary), "troubles")
    return "\n".join(
        (
            f'<p><span class="verdict {escape(verdict.replace(" ", "-"))}">{escape(verdict)}</span>'
            f" {escape(reason)}</p>",
            f'<p class="lost">{escape(lost)}</p>',
            f"<h2>Why</h2>{list_tag(why(summary), 'why')}",
            _expectations(summary),
            f"<h2>What went wrong</h2>{troubles}" if troubles else "",
            "<h2>Path following</h2>",
            f'<div class="wide">{table_tag(robot_header(), robot_rows(summary))}</div>',
            f"<p>{escape(f'{final_line(summary)}. {spread_line(summary)}')}</p>",
        )
    )


def why(summary: Summary) -> Iterator[str]:
    """The reasons of the verdict, the gravest first."""
    expected = summary["expectations"]
    for robot, reason in summary["stopped_robots"].items():
        yield f"{robot} stopped itself: {reason}"
    for held, words in _HELD.items():
        found = [one for one in expected if one["held"] is held]
        if found:
            yield f"{len(found)} of {len(expected)} expectations {words}"
    if not expected:
        yield "nothing was expected"


def _expectations(summary: Summary) -> str:
    rows = "".join(
        f'<tr><td class="state {state_of(one)}">{MARKS[state_of(one)]} {escape(mark(one))}</td>'
        f'<td class="text">{escape(label(one))}</td><td>{escape(found_value(one))}</td>'
        f'<td class="text">{escape(worst_place(one))}</td><td>{escape(margin(one))}</td></tr>'
        for held in _HELD
        for one in summary["expectations"]
        if one["held"] is held
    )
    head = "".join(
        f'<th class="text">{name}</th>' for name in ("", "expectation", "found", "worst", "margin")
    )
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return f'<div class="wide">{table}</div>' if rows else ""


def _rest(known: Known) -> Iterator[str]:
    record, _, summary = known
    yield _events(summary)
    yield f'<h2>The run</h2><div class="wide">{table_tag(("", ""), _facts(summary))}</div>'
    toml = escape(record.scenario_toml)
    yield f"<details><summary>The scenario</summary><pre>{toml}</pre></details>"


def _events(summary: Summary) -> str:
    """The events of a run as a section; nothing without any."""
    events = summary.get("events", [])
    rows = [
        (f"{it['t_s']:.6g} s", ": ".join(filter(None, (it["source"], it["kind"], it["text"]))))
        for it in events[:MOST_EVENTS]
    ]
    if len(events) > len(rows):
        rows.append(("", f"and {len(events) - len(rows)} more in {run_folder.SUMMARY}"))
    return f'<h2>Events</h2><div class="wide">{table_tag(("t", ""), rows)}</div>' if rows else ""


def _facts(summary: Summary) -> Iterable[tuple[str, str]]:
    factor = summary["real_time_factor"]
    yield "started", summary["started"]
    yield "mode", summary["mode"]
    yield "ticks", f"{summary['ticks']}"
    yield "wall time", f"{summary['wall_s']:.2f} s"
    yield "real-time factor", f"{factor:.2f}" if factor is not None else "unknown"
    yield "start, end", f"{summary['startup_s']:.2f} s, {summary['teardown_s']:.2f} s"
    yield "overruns", f"{summary['overruns']}"
    frames = (f"{bus} {count}" for bus, count in summary["frames_per_bus"].items())
    yield "frames per bus", ", ".join(frames)
    for text in network_lines(summary):
        yield "network", text
    for text in realtime_lines(summary):
        yield "clock", text
    if summary["cpu_s"]:
        cpu = (f"{process} {seconds:g} s" for process, seconds in summary["cpu_s"].items())
        yield "processor time", ", ".join(cpu)
    yield "seed", f"{summary['seed']}"
    versions = (f"{name} {number}" for name, number in summary["versions"].items())
    yield "versions", ", ".join(versions)
