"""`fleetloop report`: the figures of a run as PNG files, and one HTML page that holds them all.

<run>/figures/*.png      <run>/report.html: needs nothing beside it, no network, no script
"""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from io import BytesIO
from pathlib import Path
from string import Template
from typing import Any

from configs.errors import InfrastructureError
from configs.scenario import Scenario
from fleetloop.record.reader import Record
from fleetloop.results import run_folder
from fleetloop.results.figures import Captioned, all_figures
from fleetloop.results.known import known_of
from fleetloop.results.summary import Summary
from fleetloop.results.tables import (
    claim,
    final_line,
    mark,
    network_lines,
    realtime_lines,
    robot_header,
    robot_rows,
    spread_line,
    trouble_lines,
)

PAGE = "report.html"
MOST_EVENTS = 200
"""Of a page; summary.json has all."""
FIGURES = "figures"


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
    figures = write_figures(folder, all_figures(record, known.scenario))
    page = folder / PAGE
    run_folder.write(page, _page(known.summary, known.scenario, record, figures))
    return page


def write_figures(run: Path, figures: Iterable[Captioned]) -> list[tuple[Captioned, bytes]]:
    """Write figures into a run's folder of them; return each with its PNG file.

    Raises:
        InfrastructureError: one can't be written.
    """
    drawn = [(item, png(item)) for item in figures]
    folder = run / FIGURES
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't make {folder}: {error.strerror or error}") from error
    for item, data in drawn:
        run_folder.write(folder / f"{item.name}.png", data)
    return drawn


def png(item: Captioned) -> bytes:
    """A figure as a PNG file."""
    buffer = BytesIO()
    # No software name or date in the file: equal runs make equal figures.
    item.figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _page(
    summary: Summary,
    scenario: Scenario,
    record: Record,
    figures: Sequence[tuple[Captioned, bytes]],
) -> str:
    page = resources.files("fleetloop.results").joinpath("report.html")
    template = Template(page.read_text("utf-8"))
    return template.substitute(
        title=escape(f"Fleetloop: {scenario.name}"),
        subtitle=escape(scenario.description),
        lost=escape(f"The record isn't all there: {record.shortage()}." if record.lost else ""),
        verdict=escape(summary["verdict"]),
        verdict_class=summary["verdict"].replace(" ", "-"),
        reason=escape(summary["reason"]),
        troubles=_list(trouble_lines(summary)),
        robots=table_tag(robot_header(), robot_rows(summary)),
        spread=escape(f"{final_line(summary)}. {spread_line(summary)}"),
        expectations=table_tag(
            ("", "expectation"), ((mark(item), claim(item)) for item in summary["expectations"])
        ),
        events=_events(summary.get("events", [])),
        figures="\n".join(figure_tag(item, data) for item, data in figures),
        facts=table_tag(("", ""), _facts(summary)),
        scenario=escape(record.scenario_toml),
    )


def _events(events: Sequence[dict[str, Any]]) -> str:
    """The events of a run as a section; nothing without any."""
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
    cpu = (f"{process} {seconds:g} s" for process, seconds in summary["cpu_s"].items())
    yield "processor time", ", ".join(cpu)
    yield "seed", f"{summary['seed']}"
    versions = (f"{name} {number}" for name, number in summary["versions"].items())
    yield "versions", ", ".join(versions)


def figure_tag(item: Captioned, data: bytes) -> str:
    """A figure within a page."""
    text = escape(item.caption)
    source = f"data:image/png;base64,{base64.b64encode(data).decode()}"
    return f'<figure><img alt="{text}" src="{source}"><figcaption>{text}</figcaption></figure>'


def _list(lines: Iterable[str]) -> str:
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<h2>What went wrong</h2><ul class="troubles">{items}</ul>' if items else ""


def table_tag(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table within a page; one of two columns is text."""
    css = ' class="text"' if len(header) == 2 else ""
    head = "".join(f"<th{css}>{escape(cell)}</th>" for cell in header)
    lines = ("".join(f"<td{css}>{escape(cell)}</td>" for cell in row) for row in rows)
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
