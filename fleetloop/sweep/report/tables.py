"""A report in the terminal: counts, failure rate, what the factors do, the worst cases."""

import sys
from collections.abc import Iterator
from math import isfinite, isnan

from rich.markup import escape
from rich.table import Table

from fleetloop.results.tables import table_box
from fleetloop.sweep.report.effects import MEASURE, Bin, Effect
from fleetloop.sweep.report.results import RATES
from fleetloop.sweep.report.view import METHOD, View
from fleetloop.terminal import ResultConsole

_SHORT_WORST = 5
"""Worst cases in the terminal; the page has all that were asked for."""


def print_view(view: View) -> None:
    """Print it."""
    console = ResultConsole(file=sys.stdout, highlight=False)

    def line(text: str) -> None:
        console.print(text, soft_wrap=True, markup=False)

    line(counts_line(view))
    line(f"failed   {rate_words(view)}")
    for one in view.against:
        line(f"theory   {one.words}")
    for text in engine_lines(view):
        line(f"engine   {text}")
    if view.effects:
        table = Table(box=table_box(), padding=(0, 1, 0, 0), pad_edge=False)
        table.add_column("factor", no_wrap=True)
        table.add_column("ε²", justify="right", no_wrap=True)
        for header in ("lowest mean", "at", "highest mean", "at"):
            table.add_column(header, justify="right", no_wrap=True)
        for effect in view.effects:
            table.add_row(*(escape(text) for text in effect_row(effect)))
        line(f"effects on {view.result.label}; {MEASURE}")
        console.print_whole(table)
    if view.worst:
        console.print_whole(_worst(view))
        line(f"again    {view.worst[0].command}")


def _worst(view: View) -> Table:
    table = Table(title="worst cases", box=table_box(), padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("case", justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    table.add_column("margin", justify="right", no_wrap=True)
    names = [one.name for one in view.results.factors]
    for name in names:
        table.add_column(escape(name), justify="right", max_width=28)
    for one in view.worst[:_SHORT_WORST]:
        cells = [str(one.case), one.verdict, margin_text(one.margin)]
        cells += [value_text(one.factors[name]) for name in names]
        table.add_row(*map(escape, cells))
    return table


# --- words, of the page too -----------------------------------------------------------------------


def counts_line(view: View) -> str:
    """The study, and its cases by verdict."""
    results = view.results
    counts = ", ".join(f"{n} {verdict}" for verdict, n in results.counts.most_common())
    return f"{results.title}: {len(results)} of {results.total} cases: {counts}"


def rate_words(view: View) -> str:
    """The failure rate and its interval."""
    rate = view.rate
    if rate.value is None:
        return "unknown: no case held or failed"
    low, high = rate.interval
    return (
        f"{percent(rate.value)} of {rate.judged} that held or failed; {METHOD}'s"
        f" {100 * rate.confidence:g} % interval {percent(low)} to {percent(high)}"
    )


def engine_lines(view: View) -> Iterator[str]:
    """How many cases each engine ran, and why."""
    for engine, why, count in view.engines():
        reason = f": {why}" if why else ""
        yield f"{count} {engine or 'not run'}{reason}"


def remarks(view: View) -> Iterator[str]:
    """What a reader has to know about the data."""
    results = view.results
    if results.running:
        yield (
            f"the study is still running: {len(results)} of {results.total} cases are in this"
            " report"
        )
    elif len(results) < results.total:
        why = f" ({results.ended})" if results.ended else ""
        yield (
            f"{results.total - len(results)} of {results.total} cases aren't done{why}: go on with"
            f" fleetloop sweep --resume {results.folder}"
        )
    for text in results.damaged:
        yield f"damaged, not used: {text}"
    if results.cases is None:
        yield f"no theory's boundaries: {results.no_cases}"


def effect_row(effect: Effect) -> tuple[str, ...]:
    """A factor in the ranking: ε², and where the mean is lowest and highest."""
    share = "-" if isnan(effect.share) else f"{effect.share:.3f}"
    if not effect.bins:
        return effect.factor.label, share, "-", "-", "-", "-"
    low = min(effect.bins, key=lambda one: one.mean)
    high = max(effect.bins, key=lambda one: one.mean)
    rate = effect.result.name in RATES
    return (
        effect.factor.label,
        share,
        mean_text(low.mean, rate=rate),
        low.label,
        mean_text(high.mean, rate=rate),
        high.label,
    )


def bin_row(one: Bin, *, rate: bool) -> tuple[str, ...]:
    """A bin: cases, mean and interval."""
    known = isfinite(one.low) and isfinite(one.high)
    interval = "unknown: one case"
    if known:
        interval = f"{mean_text(one.low, rate=rate)} to {mean_text(one.high, rate=rate)}"
    return one.label, str(one.cases), mean_text(one.mean, rate=rate), interval


def mean_text(value: float, *, rate: bool) -> str:
    """A mean, or a rate."""
    return percent(value) if rate else f"{value:.4g}"


def percent(value: float) -> str:
    """A share."""
    return f"{100 * value:.3g} %"


def margin_text(margin: float | None) -> str:
    """A margin; minus infinity is a robot that stopped."""
    if margin is None:
        return "-"
    return f"{margin:.4g}" if isfinite(margin) else "stopped"


def value_text(value: object) -> str:
    """A factor's value."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
