"""compare.html: tables, claims, figures, gains and scenario on one page that needs nothing else."""

from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from string import Template

from configs.loading import to_toml
from configs.scenario import Scenario
from fleetloop.compare.claims import Claim, Verdict
from fleetloop.compare.contenders import gains_in_words
from fleetloop.compare.results import Row
from fleetloop.compare.tables import TABLES, notes, trouble_lines
from fleetloop.results import pages
from fleetloop.results.figures import Captioned
from fleetloop.results.pages import figure_tag, table_tag

_COLOUR = {Verdict.HOLDS: "yes", Verdict.DOES_NOT_HOLD: "no", Verdict.NOT_TESTABLE: "open"}


def page(
    scenario: Scenario,
    rows: Sequence[Row],
    seeds: Sequence[int],
    found: Sequence[Claim],
    figures: Iterable[tuple[Captioned, bytes]],
) -> str:
    """The page as HTML."""
    template = Template(
        resources.files("fleetloop.compare").joinpath("page.html").read_text("utf-8")
    )
    stopped = "".join(f'<p class="stopped">{escape(text)}</p>' for text in trouble_lines(rows))
    tables = "".join(
        f'<h2>{escape(columns.title)}</h2><div class="wide">'
        f"{table_tag(columns.header(), columns.rows(rows))}</div>"
        for columns in TABLES
    )
    gains = ((row.label, gains_in_words(row.scenario)) for row in rows)
    body = template.substitute(
        troubles=stopped,
        tables=tables,
        notes="".join(f'<p class="note">{escape(text)}</p>' for text in notes(seeds)),
        claims=_claims(found),
        courses_note=escape(
            f"A line per law: the greatest magnitude of any robot at each instant, seed {seeds[0]}."
            " Left the whole run on a logarithmic scale, right the final part at the scale of the"
            " laws that have settled."
        ),
        figures="\n".join(figure_tag(item.caption, data) for item, data in figures),
        gains=table_tag(
            ("law", "gains of the fleet; a robot's own are in its scenario.toml"), gains
        ),
        scenario=escape(to_toml(scenario)),
    )
    title = f"Fleetloop: laws compared on {scenario.name}"
    return pages.page(title, scenario.description, body)


def _claims(found: Sequence[Claim]) -> str:
    lines = "".join(
        f'<tr><td>{escape(one.claim)}</td><td class="where">{escape(one.where)}</td>'
        f"<td>{escape(one.measured)}</td>"
        f'<td class="state {_COLOUR[one.verdict]}">{escape(one.verdict.value)}</td></tr>'
        for one in found
    )
    head = "".join(f"<th>{text}</th>" for text in ("claim", "where", "measured", "verdict"))
    return (
        f'<div class="wide"><table class="text"><thead><tr>{head}</tr></thead>'
        f"<tbody>{lines}</tbody></table></div>"
    )
