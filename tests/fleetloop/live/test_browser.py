"""A user at a run's page, in a real browser: open, look, control the run, stop it.

The browser is Debian's Chromium, without a screen.
"""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from support.processes import Run, running

from fleetloop.door.client import open_run

pytestmark = pytest.mark.system

SCENARIO = (
    "two_robots",
    *("--speed", "1", "--duration", "100", "--allow-unchecked"),
    *("--set", "expect=[{signal='x_e_m', max_abs=99.0, name='<i>on</i> the path'}]"),
)
WAIT_MS, LOOK_MS = 20_000, 40
SHOTS = os.environ.get("FLEETLOOP_SHOTS")
"""A folder: screenshots of the page go there, to be looked at."""


class Page:
    """What a user does at the page, and sees."""

    def __init__(self, tab: Any, url: str) -> None:
        self.tab = tab
        self.requests: list[str] = []
        self.errors: list[str] = []
        tab.set_default_timeout(WAIT_MS)
        tab.on("request", lambda it: self.requests.append(it.url))
        tab.on("pageerror", lambda it: self.errors.append(str(it)))
        tab.goto(url)
        self.until("view.last !== null && view.last.tick > 0 && board !== null")

    def until(self, condition: str) -> None:
        """Wait for a condition; from outside: the page's policy forbids code made of text."""
        for _ in range(WAIT_MS // LOOK_MS):
            if self.tab.evaluate(condition):
                return
            self.tab.wait_for_timeout(LOOK_MS)
        raise AssertionError(f"not within {WAIT_MS} ms: {condition}; {self.errors}")

    def see(self, expression: str) -> Any:
        return self.tab.evaluate(expression)

    def press(self, key: str) -> None:
        self.tab.keyboard.press(key)

    def await_state(self, state: str) -> None:
        self.until(f"document.getElementById('state').textContent === '{state}'")

    def text(self, name: str) -> str:
        return str(self.tab.inner_text(f"#{name}"))

    def farthest(self, robot: str) -> float:
        """The largest error of a robot's position, x_e or y_e, that the charts draw [m]."""
        return float(self.see(farthest_of(robot)))

    def pixels(self, name: str) -> bytes:
        """What is painted of a plot."""
        return bytes(self.tab.locator(f"#{name}").screenshot())

    def shot(self, name: str) -> None:
        if SHOTS is not None:
            self.tab.screenshot(path=f"{SHOTS}/{name}.png", full_page=True)


def farthest_of(robot: str) -> str:
    """The script that finds it."""
    at = f"field(models.series_0.data, 'robot').indexOf('{robot}')"
    lines = (f"...field(models.series_0.data, '{chart}')[{at}]" for chart in ("x_e", "y_e"))
    return f"Math.max(...[{', '.join(lines)}].filter(Number.isFinite))"


@contextmanager
def page_of(browser: Any, folder: Path, **options: Any) -> Iterator[tuple[Page, Run]]:
    with running(folder, *SCENARIO, bus_time_s=0.3) as run:
        with open_run("") as client:
            url = client.ask("live.open")["url"]
        with browser.new_context(**options) as context:
            page = Page(context.new_page(), url)
            yield page, run
            assert page.errors == []
            places = {re.sub(r"^(\w+://[^/]+)?.*", r"\1", url) for url in page.requests}
            assert places - {"", url.partition("/?")[0]} == set(), "all from the page's server"


def test_a_user_looks_pauses_steps_injects_clears_and_stops(browser: Any, tmp_path: Path) -> None:
    size = {"width": 1280, "height": 900}
    with page_of(browser, tmp_path / "run", viewport=size, color_scheme="light") as (page, run):
        page.until("document.getElementById('holder').textContent === 'You have the controls.'")
        page.until("board.seen_from_s === 0 && store.data[0] < 0.05")  # from before it was opened
        assert page.text("seen") == ""
        assert page.text("scenario") == "two_robots"
        assert "<i>on</i> the path" in page.text("expectations")
        x, y = (page.see(f"field(models.bodies.data, '{it}')[0]") for it in "xy")
        assert (x**2 + y**2) ** 0.5 == pytest.approx(3.0, abs=0.5), "r1 is on its circle"
        before, t_s = page.pixels("plane_box"), page.see("view.last.t_s")
        page.until(f"view.last.t_s > {t_s + 0.5}")
        assert page.pixels("plane_box") != before, "the plane moves"
        assert page.see("document.documentElement.scrollWidth") <= 1280
        page.shot("desktop-light")

        page.press(" ")
        page.await_state("paused")
        tick = page.see("board.run.tick")
        page.tab.fill("#ticks", "5")
        page.tab.click("#step")
        page.until(f"view.last.tick === {tick + 4} || board.run.tick === {tick + 5}")
        assert page.text("state") == "paused"

        assert page.farthest("r2") < 0.3
        page.tab.click("#inject")
        page.tab.select_option("#kind", "localisation_bias")
        page.tab.fill("#parameters [name=x_m]", "0.5")
        page.tab.fill("#parameters [name=y_m]", "0.5")
        page.tab.check("#parameters [value=r2]")
        page.tab.fill("#fault_name", "shove")
        page.shot("desktop-light-form")
        page.tab.click("#fault_form button[type=submit]")
        page.press(" ")
        page.await_state("running")
        page.until("document.getElementById('faults').textContent.includes('acting')")
        page.until(farthest_of("r2") + " > 0.3")  # it is seen, whichever way the robot is heading
        page.tab.click("#clear")
        page.until("document.getElementById('faults').textContent.includes('cleared')")
        assert "shove" in page.text("events")

        page.tab.select_option("#speed", "2")
        page.until("board.run.speed === 2")
        page.tab.fill("#v_r", "0.2")
        page.tab.click("#leader button")
        page.until("board.run.leader_speed_m_s < 0.25")

        other = Page(page.tab.context.new_page(), page.tab.url)
        other.until("board.controls.holder === 'viewer 1'")
        assert other.text("holder") == "Read only: viewer 1 has the controls."
        assert other.tab.is_disabled("#pause")
        other.tab.close()
        page.tab.bring_to_front()
        page.tab.emulate_media(color_scheme="dark")
        page.until("getComputedStyle(document.body).backgroundColor === 'rgb(22, 24, 28)'")
        page.shot("desktop-dark")
        page.tab.click("#stop")
        page.tab.click("#confirm_yes")
        page.await_state("ended")
        page.until("board.verdict === 'interrupted'")  # the run's own, not that of the rows
        assert page.text("scenario") == "two_robots", "it stays readable"
        page.shot("desktop-ended")
        run.end()


def test_a_phone_shows_all_of_it_and_stops_the_drives(browser: Any, tmp_path: Path) -> None:
    size = {"width": 390, "height": 844}
    with page_of(browser, tmp_path / "run", viewport=size, color_scheme="dark", has_touch=True) as (
        page,
        run,
    ):
        page.until("document.getElementById('holder').textContent === 'You have the controls.'")
        assert page.see("document.documentElement.scrollWidth") <= 390
        for part in ("plane_box", "charts", "robots", "expectations", "processes", "estop"):
            box = page.tab.locator(f"#{part}").bounding_box()
            assert box["width"] > 100.0
            assert box["x"] >= 0.0
        assert page.see("getComputedStyle(document.body).backgroundColor") == "rgb(22, 24, 28)"
        page.shot("phone-dark")
        page.press("t")
        assert page.see("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        page.shot("phone-light")
        page.press("?")
        assert page.tab.is_visible("#help_dialog")
        page.press("Escape")
        page.press("e")
        page.tab.click("#confirm_yes")
        page.until("document.getElementById('robots').textContent.includes('stopped')")
        page.until("document.getElementById('faults').textContent.includes('drive_estop')")
        page.shot("phone-estop")
        run.send(2)
        run.end()
