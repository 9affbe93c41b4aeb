"""What README and docs show: their fenced blocks and the commands in them."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

HOME = Path(__file__).resolve().parents[2]
MADE = HOME / "docs" / "reference"
"""Pages that are made of the types in the code: see tests/docs/test_reference.py."""
PAGES = (
    HOME / "README.md",
    HOME / "examples" / "README.md",
    *(page for page in sorted((HOME / "docs").rglob("*.md")) if MADE not in page.parents),
)
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_NOT_RUN = re.compile(r"<!-- not run: ([^\n]+) -->\n+\Z")
_COMMAND = re.compile(r"(?:^|&& |uv run |\$ )(fleetloop [^\n]*)", re.MULTILINE)


class Snippet(NamedTuple):
    """One fenced block."""

    where: str  # page and line
    language: str
    text: str
    not_run: str = ""
    """The page's reason why no test runs all of it: `<!-- not run: REASON -->` before the block."""


def snippets(*languages: str) -> list[Snippet]:
    """All fenced blocks of these languages; "" is a block without one."""
    found = []
    for page in PAGES:
        text = page.read_text("utf-8")
        for block in _BLOCK.finditer(text):
            line = text.count("\n", 0, block.start()) + 1
            where = f"{page.relative_to(HOME)}:{line}"
            reason = _NOT_RUN.search(text[: block.start()])
            found.append(Snippet(where, block[1], block[2], reason[1] if reason else ""))
    return [snippet for snippet in found if snippet.language in languages]


def commands() -> Iterator[tuple[str, list[str]]]:
    """(page and line, words) of every `fleetloop` command in blocks of shell and terminal."""
    for snippet in snippets("sh", ""):
        for match in _COMMAND.finditer(snippet.text):
            yield snippet.where, shlex.split(re.sub(r"\s#.*", "", match[1]))
    for page in PAGES:
        for match in re.finditer(r"`(fleetloop [^`\n]*)`", page.read_text("utf-8")):
            words = shlex.split(match[1].replace("[", "").replace("]", ""))
            if "VERB" not in words and "..." not in words:
                yield str(page.relative_to(HOME)), words
