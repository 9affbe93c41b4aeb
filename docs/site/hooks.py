"""Hooks of mkdocs: pages that nav doesn't name, links out of docs/, formulas without JavaScript.

A page at the top of docs/ that nav doesn't name is put at the end of the how-to pages, so that a
new page is on the site without another edit. A link to a file that isn't in docs/ is the file's
name on the site. Formulas are TeX between dollars, which GitHub sets itself; here they become
MathML, which browsers set without a script or a font from elsewhere.
"""

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

HOW_TO = "How to"
_UPWARDS = re.compile(r"\[([^\]]+)\]\(((?:\.\./)+[^)#]+)(?:#[^)]*)?\)")
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


def on_page_markdown(markdown: str, page: Any, config: Any, **_: Any) -> str:
    """Name the files that links out of docs/ lead to."""
    docs = Path(config.docs_dir)

    def named(link: re.Match[str]) -> str:
        target = (docs / page.file.src_path).parent.joinpath(link[2]).resolve()
        if docs in target.parents:
            return link[0]
        return f"{link[1]} (`{target.relative_to(docs.parent)}` of the repository)"

    return _UPWARDS.sub(named, markdown)


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
