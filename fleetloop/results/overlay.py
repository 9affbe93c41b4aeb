"""`fleetloop report A B C`: several runs on one page, side by side and over each other.

<out>/report.html: needs nothing beside it      <out>/figures/*.png
"""

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from bridge.process.clock import SYSTEM_CLOCK
from configs.errors import ScenarioError
from fleetloop.record.reader import Record
from fleetloop.results import run_folder, tables
from fleetloop.results.drawing import COLOURS
from fleetloop.results.known import Known, known_of
from fleetloop.results.overlay_figures import PANELS, overlay_figures, robots_of
from fleetloop.results.pages import figure_tag, page, resource
from fleetloop.results.publication import write_figures
from fleetloop.results.report import PAGE
from fleetloop.results.summary import Summary
from fleetloop.results.tables import finding, mark, number, settled_at

MOST_RUNS = len(COLOURS)
MOST_KEYS = 60
"""Lines of what differs in the scenarios."""
_MOST_CHARACTERS = 60

Cell = Callable[[Summary], str]


def write_overlay(runs: Sequence[Path], records: Sequence[Record], out: Path | None) -> Path:
    """Make the page of several runs; return it.

    Args:
        runs: as they were named.
        records: of each.
        out: the folder, new or empty; None: runs/<time>-overlay.

    Raises:
        ScenarioError: more runs than colours, one has nothing to show, or `out` isn't empty.
        InfrastructureError: the page or a figure can't be written.
    """
    if len(runs) > MOST_RUNS:
        raise ScenarioError(f"{len(runs)} runs: at most {MOST_RUNS} can be told apart on one page")
    known = dict(zip(labels(runs), map(known_of, records), strict=True))
    folder = run_folder.create("overlay", out, SYSTEM_CLOCK.wall_ns()).path
    figures = write_figures(folder, overlay_figures(known))
    written = folder / PAGE
    tags = [figure_tag(item.caption, data) for item, data in figures]
    run_folder.write(written, _page(known, tags))
    return written


def labels(runs: Sequence[Path]) -> list[str]:
    """Short names of runs: of their folders, as far as these differ."""
    folders = [run if run.suffix != ".mcap" else run.parent for run in runs]
    names = [folder.resolve().name for folder in folders]
    found = names if len(set(names)) == len(names) else [str(folder) for folder in folders]
    if len(set(found)) < len(found):
        found = [f"{name} ({n})" for n, name in enumerate(found, 1)]
    return found


def _page(runs: Mapping[str, Known], figures: Sequence[str]) -> str:
    names = dict.fromkeys(run.scenario.name for run in runs.values())
    lost = (
        f"{label}: the record isn't all there: {run.record.shortage()}"
        for label, run in runs.items()
        if run.record.lost
    )
    robots = len(robots_of({label: run.record for label, run in runs.items()}))
    how = (
        "A colour and a dash pattern per run; a panel per robot."
        if robots <= PANELS
        else f"A colour per run; a band covers all {robots} robots."
    )
    body = Template(resource("overlay.html")).substitute(
        lost="".join(f'<p class="lost">{escape(text)}</p>' for text in lost),
        results=_results(runs),
        expectations=_expectations(runs),
        keys=_keys(runs),
        how=escape(how),
        figures="\n".join(figures),
    )
    return page(f"Fleetloop: {len(runs)} runs", f"Scenarios: {', '.join(names)}", body)


def _of_worst(group: str, name: str, spec: str | None) -> Cell:
    def cell(summary: Summary) -> str:
        if not summary["robots"]:
            return "-"
        value = summary["worst"][group][name]
        return settled_at(value) if spec is None else number(value, spec)

    return cell


def _of_spread(name: str, spec: str | None) -> Cell:
    def cell(summary: Summary) -> str:
        if summary["s_spread"] is None:
            return "-"
        value = summary["s_spread"][name]
        return settled_at(value) if spec is None else number(value, spec)

    return cell


def _peak(summary: Summary) -> str:
    return number(summary["worst"]["peak_torque_wheel_N_m"], ".2f") if summary["robots"] else "-"


_CELLS: tuple[tuple[str, Cell], ...] = (
    ("scenario", lambda summary: str(summary["scenario"])),
    ("mode", lambda summary: str(summary["mode"])),
    ("seed", lambda summary: str(summary.get("seed", "-"))),
    ("started", lambda summary: str(summary["started"])[:19].replace("T", " ")),
    ("robots", lambda summary: str(len(summary["robots"]))),
    ("simulated [s]", lambda summary: f"{summary['simulated_s']:g}"),
    ("wall time [s]", lambda summary: f"{summary['wall_s']:.2f}"),
    ("x_e final [m]", _of_worst("final_max", "x_e_m", ".5f")),
    ("y_e final [m]", _of_worst("final_max", "y_e_m", ".5f")),
    ("θ_e final [rad]", _of_worst("final_max", "theta_e_rad", ".5f")),
    ("x_e settled", _of_worst("settle_s", "x_e_m", None)),
    ("y_e settled", _of_worst("settle_s", "y_e_m", None)),
    ("θ_e settled", _of_worst("settle_s", "theta_e_rad", None)),
    ("spread of s, peak [m]", _of_spread("peak", ".4f")),
    ("spread of s, final [m]", _of_spread("final", ".2e")),
    ("spread of s settled", _of_spread("settle_s", None)),
    ("τ peak [N·m]", _peak),
)


def _results(runs: Mapping[str, Known]) -> str:
    rows = [
        ("verdict", [_verdict(run.summary["verdict"]) for run in runs.values()]),
        *((name, [escape(cell(run.summary)) for run in runs.values()]) for name, cell in _CELLS),
    ]
    return _table(runs, rows)


def _expectations(runs: Mapping[str, Known]) -> str:
    by_claim: dict[str, dict[str, str]] = {}
    for label, run in runs.items():
        for expect in run.summary["expectations"]:
            said = f"{_verdict(mark(expect))}<br>{escape(finding(expect))}"
            by_claim.setdefault(tables.label(expect), {})[label] = said
    if not by_claim:
        return "<p>None of these runs has any.</p>"
    rows = [(claim, [said.get(label, "-") for label in runs]) for claim, said in by_claim.items()]
    return _table(runs, rows)


def _keys(runs: Mapping[str, Known]) -> str:
    scenarios = [dict(_flat(tomllib.loads(run.record.scenario_toml))) for run in runs.values()]
    keys = dict.fromkeys(key for one in scenarios for key in one)
    differ = [key for key in keys if len({one.get(key, "-") for one in scenarios}) > 1]
    if not differ:
        return "<p>Nothing: they ran the same scenario.</p>"
    rows = [(key, [escape(one.get(key, "-")) for one in scenarios]) for key in differ[:MOST_KEYS]]
    more = len(differ) - len(rows)
    return _table(runs, rows) + (f"<p>and {more} keys more</p>" if more else "")


def _flat(value: Any, key: str = "") -> Iterable[tuple[str, str]]:
    """Every key of a scenario with its value, tables in lists by their names."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        for n, inner in enumerate(value):
            yield from _flat(inner, f"{key}.{inner.get('name', n)}")
    else:
        text = str(value)
        short = text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]}…"
        yield key, short


def _verdict(text: str) -> str:
    css = text.lower().replace(" ", "-")
    return f'<span class="{escape(css)}">{escape(text)}</span>'


def _table(runs: Mapping[str, Known], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """A column per run under its colour; cells are HTML."""
    head = "".join(
        f'<th><span class="swatch" style="background:{COLOURS[n]}"></span>{escape(label)}</th>'
        for n, label in enumerate(runs)
    )
    body = "".join(
        f"<tr><td>{escape(name)}</td>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
        for name, cells in rows
    )
    return f"<table><thead><tr><th></th>{head}</tr></thead><tbody>{body}</tbody></table>"
