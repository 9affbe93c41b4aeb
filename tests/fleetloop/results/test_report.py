"""The page of a run: words of users are shown as they are, and are nothing else."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import pytest

from configs.events import Event
from configs.loading import load, to_toml
from configs.signals import law_table
from fleetloop.record.reader import Record
from fleetloop.results.figures import law_signals
from fleetloop.results.known import Known
from fleetloop.results.pictures import png
from fleetloop.results.report import page_of
from fleetloop.results.sections import sections
from fleetloop.results.summary import RunStats, summarise
from fleetloop.results.view import View

HOSTILE = r"""</script><img src=x onerror=alert(1)>'"`${1}<!-- &lt; \u003c \b"""
PUSH = {"kind": "push", "name": "shove", "at_s": 1.0, "for_s": 0.5}


def known_with(words: str, run: Path) -> Known:
    """A run in which a user, and a law of the user's own, said this wherever they may."""
    expect = {"name": words, "signal": "x_e_m", "max_abs": 1e-9, "from_s": 1.0}
    changes = {"description": words, "expect": [expect], "fault": [PUSH]}
    scenario = load("two_robots").with_(changes)
    record = Record.open(run / "record.mcap")
    signals = {
        robot: tuple(
            one._replace(unit=words, meaning=words) if one in law_table(table) else one
            for one in table
        )
        for robot, table in record.signals.items()
    }
    record = replace(record, signals=signals, scenario_toml=to_toml(scenario), lost=words)
    events = [Event(5, "r1", "stopped", words), Event(9, "r2", "law", words)]
    summary = summarise(
        record, scenario, RunStats("lockstep", events=events, stopped_robots={"r1": words})
    )
    return Known(record, scenario, summary)


class Parts(HTMLParser):
    """Elements with the names of their attributes; what is written outside of scripts."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, ...]] = []
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, *(name for name, _ in attrs)))

    def handle_data(self, data: str) -> None:
        if self.cdata_elem is None:
            self.text += data


def texts(value: object) -> Iterator[str]:
    """Every text in a JSON value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from texts(inner)


@pytest.fixture(scope="module")
def page(finished_run: Path) -> str:
    return page_of(known_with(HOSTILE, finished_run), ())


def test_words_of_users_make_no_element_and_no_attribute(page: str, finished_run: Path) -> None:
    plain = page_of(known_with("words", finished_run), ())
    assert Parts(page).elements == Parts(plain).elements


def test_words_of_users_are_on_the_page_as_they_are(page: str) -> None:
    text = Parts(page).text
    assert text.count(HOSTILE) >= 7
    assert f"stopped itself: {HOSTILE}" in text
    assert f"r2: law: {HOSTILE}" in text


def test_words_of_users_reach_the_plots_as_data(page: str) -> None:
    (said,) = re.findall(r"const docs_json = '(.*)';", page)
    found = list(texts(json.loads(unescape(said.replace(r"\\", "\\")))))  # as Bokeh undoes it
    assert any(f"[{HOSTILE}]" in one for one in found)


def test_a_panel_of_one_robot_has_what_is_expected_of_it_and_where_it_was_worst(
    finished_run: Path,
) -> None:
    both = {"signal": "tau_right_wheel_N_m", "max_abs": 1e-3}
    expect = [both, both | {"robots": ["r2"], "max_abs": 2e-3}]
    scenario = load("two_robots").with_(expect=expect)
    record = Record.open(finished_run / "record.mcap")
    summary = summarise(record, scenario, RunStats("lockstep"))
    (torques,) = (one for one in sections(View(record, scenario, summary)) if one.key == "torques")
    worst = [one["worst"]["robots"] for one in summary["expectations"]]
    for robot, panel in zip(("r1", "r2"), torques.panels, strict=True):
        levels = {bound.level for bound in panel.bounds}
        assert levels >= {1e-3, -1e-3}
        assert (2e-3 in levels) == (robot == "r2")
        assert len(panel.spots) == worst.count([robot])


def test_a_unit_is_no_formula(finished_run: Path) -> None:
    record, scenario, _ = known_with(r"$\frac$", finished_run)
    assert png(law_signals(record, scenario)).startswith(b"\x89PNG")
