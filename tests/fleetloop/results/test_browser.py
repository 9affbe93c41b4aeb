"""A reader of a run's page, in a real browser."""

from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from matplotlib.image import imread

pytestmark = pytest.mark.system


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_plots_follow_the_themes_of_the_button_and_of_the_system(
    browser: Any,
    finished_run: Path,
    scheme: str,
) -> None:
    errors: list[str] = []
    tab = browser.new_page(color_scheme=scheme, viewport={"width": 390, "height": 800})
    tab.on("pageerror", lambda it: errors.append(str(it)))
    tab.goto((finished_run / "report.html").as_uri())
    tab.wait_for_selector("html[data-ready=yes]")

    def plots_are_dark() -> set[bool]:
        plots = [tab.locator(".bk-Figure").nth(n) for n in (0, 2, -1)]
        images = [imread(BytesIO(plot.screenshot()), format="png") for plot in plots]
        return {bool(image[..., :3].mean() < 0.5) for image in images}

    is_dark = scheme == "dark"
    assert plots_are_dark() == {is_dark}
    tab.click("#theme")
    assert plots_are_dark() == {not is_dark}
    tab.click("#theme")
    assert plots_are_dark() == {is_dark}
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    assert errors == []
    tab.close()


def test_plots_follow_the_systems_theme_while_the_page_is_open(
    browser: Any,
    finished_run: Path,
) -> None:
    errors: list[str] = []
    tab = browser.new_page(color_scheme="light")
    tab.on("pageerror", lambda it: errors.append(str(it)))
    tab.goto((finished_run / "report.html").as_uri())
    tab.wait_for_selector("html[data-ready=yes]")
    tab.emulate_media(color_scheme="dark")
    image = imread(BytesIO(tab.locator(".bk-Figure").nth(2).screenshot()), format="png")
    assert image[..., :3].mean() < 0.5
    assert errors == []
    tab.close()
