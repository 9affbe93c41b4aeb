"""A run in a notebook (HTML) and in a terminal (rich): the table of its robots and its verdict."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from fleetloop.results.pages import list_tag, table_tag
from fleetloop.results.summary import Summary
from fleetloop.results.tables import (
    final_line,
    marked_claim,
    robot_header,
    robot_rows,
    spread_line,
    trouble_lines,
)

if TYPE_CHECKING:
    from rich.console import RenderableType


def html(summary: Summary, notes: Sequence[str]) -> str:
    """A fragment of HTML; what a user named is escaped."""
    head = f"<b>{escape(verdict_line(summary))}</b>"
    table = table_tag(robot_header(), robot_rows(summary))
    return f"<div>{head}{table}{list_tag(lines(summary))}{list_tag(notes)}</div>"


def lines(summary: Summary) -> list[str]:
    """What is below the table."""
    expected = map(marked_claim, summary["expectations"])
    said = [f"{final_line(summary)}; {spread_line(summary)}", *expected]
    return [*said, *trouble_lines(summary)]


def verdict_line(summary: Summary) -> str:
    """Scenario, mode, verdict and reason."""
    reason = f": {summary['reason']}" if summary["reason"] else ""
    return (
        f"{summary['scenario']}, {summary['mode']}, {summary['simulated_s']:g} s:"
        f" {summary['verdict']}{reason}"
    )


def renderable(summary: Summary) -> "RenderableType":
    """The same for rich's consoles."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(verdict_line(summary)))
    first, *others = robot_header()
    table.add_column(Text(first), no_wrap=True)
    for header in others:
        table.add_column(Text(header), justify="right")
    for row in robot_rows(summary):
        table.add_row(*map(Text, row))
    return Group(table, *map(Text, lines(summary)))
