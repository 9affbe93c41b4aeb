"""report.html of a study: numbers, figures, worst cases, on one page that needs nothing else."""

from collections.abc import Iterator, Sequence
from html import escape
from importlib import resources
from math import isnan
from string import Template

from fleetloop.results import pages
from fleetloop.results.drawing import PAGE_IN
from fleetloop.results.pages import figure_tag, table_tag
from fleetloop.results.publication import Drawn
from fleetloop.sweep.dataset import PARTS
from fleetloop.sweep.report.effects import MEASURE
from fleetloop.sweep.report.figures import GROWTH, INEQUALITY, MAP, THEORY_MAP
from fleetloop.sweep.report.results import RATES
from fleetloop.sweep.report.tables import (
    bin_row,
    effect_row,
    margin_text,
    rate_words,
    remarks,
    value_text,
)
from fleetloop.sweep.report.view import View, Worst
from fleetloop.sweep.theory import NEAR_1_S

PAGE = "report.html"
MAPS = MAP, THEORY_MAP, INEQUALITY, GROWTH
"""Figures side by side."""
MOST_REASON = 240
"""Characters; the dataset has all."""
OPENERS = (
    ("pandas", 'import pandas; df = pandas.read_parquet("{parts}")'),
    ("polars", 'import polars; df = polars.read_parquet("{parts}/part-*.parquet")'),
    ("duckdb", "import duckdb; df = duckdb.sql(\"FROM '{parts}/part-*.parquet'\").df()"),
)
"""A line each that opens a dataset."""


def page(view: View, figures: Sequence[Drawn]) -> str:
    """The page as HTML."""
    room = resources.files("fleetloop.sweep.report")
    results = view.results
    tags = {
        item.name: figure_tag(item.caption, data, across=item.figure.get_figwidth() > 0.9 * PAGE_IN)
        for item, data in figures
    }
    parts = results.folder / PARTS
    shown_map = "".join(tags.pop(name, "") for name in MAPS)
    if view.heat is None:
        shown_map += f'<p class="note">No map: {escape(view.no_map)}.</p>'
    body = Template(room.joinpath("page.html").read_text("utf-8")).substitute(
        remarks="".join(f'<p class="lost">{escape(text)}</p>' for text in remarks(view)),
        rate=escape(f"Failure rate {rate_words(view)}"),
        facts=escape(_facts(view)),
        theory=_theory(view),
        verdicts=_verdicts(view),
        engines=table_tag(
            ("engine", "why not the kernel", "cases"),
            ((engine or "not run", why or "-", str(n)) for engine, why, n in view.engines()),
        ),
        figures_map=f'<h2>Map</h2><div class="maps">{shown_map}</div>',
        effects=_effects(view),
        figures_effects=tags.pop("main_effects", ""),
        figures_rest="".join(tags.values()),
        bins=_bins(view),
        worst=_worst(view),
        troubles=_troubles(view),
        parts=escape(str(parts)),
        open=escape("\n".join(f"{line.format(parts=parts)}  # {name}" for name, line in OPENERS)),
        study=escape(results.cases.plan.text if results.cases else results.no_cases),
    )
    return pages.page(
        f"Fleetloop: {results.title}",
        str(results.told.get("description", "")),
        body,
        style=room.joinpath("page.css").read_text("utf-8"),
    )


def _facts(view: View) -> str:
    results, told = view.results, view.results.told
    facts = [
        f"{len(results)} of {results.total} cases of {told.get('base', 'an unknown base')}",
        f"design {str(told.get('design', 'unknown')).replace('_', ' ')}",
        f"seed {told.get('seed', 'unknown')}",
    ]
    if results.ended:
        facts.append(f"ended: {results.ended}")
    return "; ".join(facts)


def _theory(view: View) -> str:
    """How often simulation and theory say the same."""
    if not view.against:
        return ""
    rows = (
        (
            one.words.partition(":")[0] + (", the verdict" if one.judges else ""),
            str(one.agree),
            str(one.disagree),
            f"{one.farthest_1_s:.2g}" if one.disagree else "-",
            f"{one.off_1_s:.2g}",
        )
        for one in view.against
    )
    header = (
        "simulation against", "agree", "disagree", "of at most [1/s]",
        f"apart, within {NEAR_1_S:g} 1/s of the boundary [1/s]",
    )  # fmt: skip
    first = view.against[0]
    note = (
        f"{first.unstable} of {first.unstable + first.stable} cases are unstable as simulated;"
        f" the least growth of any, in magnitude, is {first.least_1_s:.2g} 1/s."
    )
    return f'<div class="wide">{table_tag(header, rows)}</div><p class="note">{escape(note)}</p>'


def _verdicts(view: View) -> str:
    results = view.results
    rows = "".join(
        f'<tr><td class="state {escape(verdict.replace(" ", "-"))}">{escape(verdict)}</td>'
        f"<td>{n}</td><td>{100 * n / len(results):.3g} %</td></tr>"
        for verdict, n in results.counts.most_common()
    )
    head = "<th>verdict</th><th>cases</th><th>share</th>"
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _effects(view: View) -> str:
    """The ranking, and ε² of all results."""
    if not view.effects:
        return '<p class="note">No factor has several values here.</p>'
    header = ("factor", "ε²", "lowest mean", "at", "highest mean", "at")
    ranking = table_tag(header, map(effect_row, view.effects))
    left_out = [one.name for one in view.results.factors if one not in view.factors]
    more = f" Not ranked: {', '.join(left_out)}: one value, or too many texts." if left_out else ""
    shares = view.shares()
    rows = (
        (result.label, *("-" if isnan(share) else f"{share:.2f}" for share in found))
        for result, found in shares
    )
    names = [one.label for one in view.factors]
    every = table_tag(("ε² on", *names), rows) if shares else ""
    return (
        f"<h3>On {escape(view.result.label)}</h3>"
        f'<div class="wide">{ranking}</div><p class="note">{escape(MEASURE)}.{escape(more)}</p>'
        f'<h3>On every result</h3><div class="wide">{every}</div>'
    )


def _bins(view: View) -> str:
    rate = view.result.name in RATES
    header = ("", "cases", (view.result.label if rate else "mean"), "interval")
    tables = "".join(
        f'<h3>{escape(one.factor.label)}</h3><div class="wide">'
        f"{table_tag(header, (bin_row(found, rate=rate) for found in one.bins))}</div>"
        for one in view.effects
        if one.bins
    )
    label = escape(view.result.label)
    what = f"{label[0].upper()}{label[1:]} by level and bin"
    return f"<details><summary>{what}</summary>{tables}</details>" if tables else ""


def _worst(view: View) -> str:
    if not view.worst:
        return '<p class="note">No case was judged.</p>'
    names = [one.name for one in view.results.factors]
    head = "".join(
        f"<th>{escape(name)}</th>" for name in ("case", "verdict", "margin", *names, "whole run")
    )
    rows = "".join(line for one in view.worst for line in _worst_rows(one, names))
    note = (
        "Failed ones first, then by margin. A click on a command selects it all;"
        " it runs the case again, exactly, in any folder."
    )
    return (
        f'<p class="note">{note}</p><div class="wide"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _worst_rows(one: Worst, names: Sequence[str]) -> Iterator[str]:
    record = "-"
    if one.record:
        record = f'<a href="{escape(one.record)}/">{escape(one.record)}</a>'
    values = "".join(f"<td>{escape(value_text(one.factors[name]))}</td>" for name in names)
    yield (
        f'<tr class="case"><td>{one.case}</td>'
        f'<td class="state {escape(one.verdict.replace(" ", "-"))}">{escape(one.verdict)}</td>'
        f"<td>{escape(margin_text(one.margin))}</td>{values}<td>{record}</td></tr>"
    )
    text = one.reason if len(one.reason) <= MOST_REASON else f"{one.reason[:MOST_REASON]}…"
    reason = f'<span class="reason">{escape(text)}</span>' if text else ""
    yield (
        f'<tr class="command"><td colspan="{len(names) + 4}">{reason}'
        f"<code>{escape(one.command)}</code></td></tr>"
    )


def _troubles(view: View) -> str:
    found = view.without_result()
    if not found:
        return ""
    rows = "".join(
        f'<tr class="case"><td class="state {escape(verdict)}">{escape(verdict)}</td><td>{n}</td>'
        f'<td>{first}</td><td class="text">{escape(reason)}</td></tr>'
        f'<tr class="command"><td colspan="4"><code>{escape(command)}</code></td></tr>'
        for verdict, reason, n, first, command in found
    )
    head = '<th>verdict</th><th>cases</th><th>first</th><th class="text">reason</th>'
    return (
        f'<h2>Cases without a result</h2><div class="wide"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )
