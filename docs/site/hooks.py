"""Hooks of mkdocs: pages that mkdocs.yml's nav doesn't name, and formulas without JavaScript.

A page at the top of docs/ that nav doesn't name is put at the end of the how-to pages, so that a
new page is on the site without another edit. Formulas are TeX between dollars, which GitHub sets
itself; here they become MathML, which browsers set without a script or a font from elsewhere.
"""

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

HOW_TO = "How to"
_FORMULA = re.compile(
    r'<(span|div) class="arithmatex">(?:\\\(|\\\[)(.*?)(?:\\\)|\\\])</\1>', re.DOTALL
)


def on_config(config: Any) -> Any:
    """Add the pages that nav doesn't name."""
    named = set(_pages(config.nav))
    forgotten = [page.name for page in sorted(Path(config.docs_dir).glob("*.md"))]
    (how_to,) = (part[HOW_TO] for part in config.nav if HOW_TO in part)
    how_to += [page for page in forgotten if page not in named]
    return config


def _pages(nav: Any) -> list[str]:
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    return [page for part in parts for page in _pages(part)]


def on_page_content(content: str, **_: Any) -> str:
    """Set the formulas of a page."""
    return _FORMULA.sub(_math, content)


def _math(formula: re.Match[str]) -> str:
    display = "block" if formula[1] == "div" else "inline"
    tex = html.unescape(formula[2]).strip()
    made: str = convert(tex, display=display)
    if "\\" in made:
        raise PluginError(f"latex2mathml doesn't know all commands of: {tex}")
    return made
