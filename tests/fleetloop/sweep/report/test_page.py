"""The page: all of it there, nothing fetched, nothing that a user named taken for HTML."""

import re
from html import unescape
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from support.browser import browser
from support.studies import FEW, SHORT, P
from support.study_results import Came, made_study

from fleetloop.results.publication import write_figures
from fleetloop.sweep.report.command import figures_of
from fleetloop.sweep.report.derived import with_derived
from fleetloop.sweep.report.page import OPENERS, page
from fleetloop.sweep.report.results import results_of
from fleetloop.sweep.report.view import Choice, View, view_of

__all__ = ["browser"]
TEXT = SHORT.replace('"short"', '"<i>p</i> & law"') + 'design = "grid"\n' + P
TEXT += '[[factor]]\nkey = "control.law"\nvalues = ["adaptive_dsc", "adaptive_dsc_robust"]\n' + FEW


def some(case) -> Came:
    if case["p"] == 0.5:
        return Came("failed", -0.25, "r1: |x_e| < 0.2 & broken")
    if case["p"] == 1.0:
        return Came("invalid", None, "p: must be <more>", engine=("", ""))
    return Came("held", 0.5, engine=("in process", "wire timing"))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[View, str]:
    folder = made_study(tmp_path_factory.mktemp("study"), TEXT, some)
    view = view_of(with_derived(results_of(folder)), Choice())
    shown = page(view, write_figures(folder, figures_of(view)))
    (folder / "report.html").write_text(shown, "utf-8")
    return view, shown


def test_it_has_every_figure_and_every_worst_case_with_its_command(made) -> None:
    view, shown = made
    assert shown.count("<figure") == len(figures_of(view))
    commands = [unescape(text) for text in re.findall(r"<code>(fleetloop.*?)</code>", shown)]
    for one in view.worst:
        assert one.command in commands
    for _, reason, _, _, command in view.without_result():
        assert command in commands
        assert reason in unescape(shown)


def test_it_says_how_often_simulation_contradicts_theory(tmp_path: Path) -> None:
    text = SHORT.replace('"until_s=0.1"', '"until_s=0.1", "robot.r2.s_0=0.1"')
    text += 'design = "grid"\n' + P + "[theory]\n" + FEW
    values = {"growth_1_s": 0.2, "growth_sampled_1_s": 0.2, "growth_46_1_s": -0.1}
    folder = made_study(tmp_path / "study", text, lambda _: Came("held", 0.2, "", values))
    shown = page(view_of(with_derived(results_of(folder)), Choice()), [])
    cells = re.findall(r"<td[^>]*>(.*?)</td>", shown)
    first = cells.index("the law as sampled, the verdict")
    assert cells[first : first + 4] == ["the law as sampled, the verdict", "3", "0", "-"]
    assert cells[first + 6 : first + 9] == ["0", "3", "0.2"]


def test_what_a_user_named_is_text(made) -> None:
    _, shown = made
    assert "<i>p</i>" not in shown
    assert "&lt;i&gt;p&lt;/i&gt; &amp; law" in shown
    assert "must be &lt;more&gt;" in shown


def test_it_says_rate_interval_engines_and_measure(made) -> None:
    text = unescape(re.sub(r"<[^>]+>", " ", made[1]))
    assert "Failure rate 50 % of 4 that held or failed; Wilson's 95 % interval 15 % to 85 %" in text
    assert "wire timing" in text
    assert "Kruskal-Wallis, corrected for chance" in text


def test_nothing_is_fetched(made) -> None:
    sources = re.findall(r'(?:src|href)="([^"]*)"', made[1])
    assert all(one.startswith(("data:image/png", "worst/", "#")) for one in sources)
    assert "http" not in re.sub(r"<pre>.*?</pre>", "", made[1], flags=re.DOTALL)


def test_the_line_for_pandas_opens_the_dataset(made) -> None:
    view, shown = made
    parts = view.results.folder / "parts"
    lines = dict(OPENERS)
    assert all(line.format(parts=parts) in unescape(shown) for line in lines.values())
    found: dict[str, Any] = {}
    exec(lines["pandas"].format(parts=parts), found)
    assert isinstance(found["df"], pd.DataFrame)
    assert len(found["df"]) == 6


@pytest.mark.parametrize("name", ["polars", "duckdb"])
def test_the_lines_for_others_open_it_where_they_are(made, name: str) -> None:
    pytest.importorskip(name)
    found: dict[str, Any] = {}
    exec(dict(OPENERS)[name].format(parts=made[0].results.folder / "parts"), found)
    assert len(found["df"]) == 6


@pytest.mark.system
@pytest.mark.timeout(120)
@pytest.mark.parametrize("width", [1280, 400])
def test_it_is_as_wide_as_its_window(browser, made, width: int) -> None:
    path: Path = made[0].results.folder / "report.html"
    with browser.new_page(viewport={"width": width, "height": 900}) as shown:
        errors: list[str] = []
        shown.on("pageerror", lambda error: errors.append(str(error)))
        shown.goto(path.as_uri())
        assert shown.evaluate("document.documentElement.scrollWidth") <= width
        assert errors == []


@pytest.mark.system
@pytest.mark.timeout(120)
def test_a_click_on_a_command_selects_all_of_it(browser, made) -> None:
    view, _ = made
    with browser.new_page() as shown:
        shown.goto((view.results.folder / "report.html").as_uri())
        shown.locator("tr.command code").first.click()
        assert shown.evaluate("getSelection().toString()").strip() == view.worst[0].command
