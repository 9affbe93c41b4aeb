"""Links within the repository lead somewhere, on its host as on the site."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.snippets import HOME

from docs.generate.scenario import slug

PAGES = (HOME / "README.md", *sorted((HOME / "docs").rglob("*.md")))
ROOMS = ("agents", "bridge", "configs", "fleetloop", "plant", "tests", "benchmarks")
_FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def anchors(page: Path) -> Iterator[str]:
    """Addresses of a page's headings."""
    seen: dict[str, int] = {}
    for heading in _HEADING.findall(_FENCE.sub("", page.read_text("utf-8"))):
        address = slug(_LINK.sub("]", heading))
        seen[address] = seen.get(address, -1) + 1
        yield f"{address}-{seen[address]}" if seen[address] else address


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(HOME)))
def test_links_of_a_page_lead_somewhere(page: Path) -> None:
    for link in _LINK.findall(_FENCE.sub("", page.read_text("utf-8"))):
        if link.startswith(("http://", "https://")):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in set(anchors(target)), link


def test_pages_that_code_names_exist() -> None:
    named = {
        name
        for room in ROOMS
        for file in (HOME / room).rglob("*.py")
        for name in re.findall(r"docs/[\w/-]+\.md", file.read_text("utf-8"))
    }
    assert [name for name in sorted(named) if not (HOME / name).is_file()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(HOME)))
def test_files_that_a_page_names_exist(page: Path) -> None:
    rooms = "|".join((*ROOMS, "docs", "packaging"))
    named = re.findall(rf"`((?:{rooms})/[\w/.-]+\.\w+)`", page.read_text("utf-8"))
    assert [name for name in named if not (HOME / name).exists()] == []
