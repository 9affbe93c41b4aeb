"""Pages that lead through files and commands lead where they say."""

from pathlib import Path

import pytest
from support.snippets import snippets
from support.walkthrough import Command, do, files_and_commands, write

UNLESS_SHOWN = {"check", "report", "compare"}
"""Other tests run them; here they would take most of the time."""


@pytest.mark.parametrize("page", ["tutorial", "path", "drive-protocol"])
def test_a_page_leads_where_it_says(page: str, tmp_path: Path) -> None:
    shown = snippets("toml", "python", "sh", "")
    blocks = [one for one in shown if one.where.startswith(f"docs/{page}.md:")]
    done = 0
    for step in files_and_commands(blocks):
        if not isinstance(step, Command):
            if step.text.startswith("# ") or step.language == "python":
                write(tmp_path, step)
        elif step.said or step.words[0] not in UNLESS_SHOWN:
            do(tmp_path, step)
            done += 1
    assert done
