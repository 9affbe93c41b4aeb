"""A page as a walk through it: files are written, commands done, in the order of the page.

A block whose first line is `# NAME` is that file; `# NAME, at its end` is appended to it, and
`# NAME, [table]` takes the place of that table. Commands run in this process. Behind one, the lines
of a block without a language are lines of its output.
"""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from support.command_line import fleetloop
from support.snippets import Snippet

_FILE = re.compile(r"# (\w+\.\w+)(?:, (at its end|\[\w+\]))?\n")
_VERB = re.compile(r"^(?:\.uv/bin/uv run )?fleetloop (.*)$", re.MULTILINE)
_STATUS = re.compile(r"\s*# exit status (\d+)$")
_IN_PROCESS = ("--in-process", "--no-report")
_SHORT = ("--duration", "0.2", "--allow-unchecked")


class Command(NamedTuple):
    """A command of the page, and lines that it prints."""

    where: str
    words: tuple[str, ...]
    status: int
    said: tuple[str, ...] = ()


def files_and_commands(blocks: list[Snippet]) -> Iterator[Snippet | Command]:
    """What the page has its reader do, in its order."""
    for block, after in zip(blocks, [*blocks[1:], None], strict=True):
        if block.language in ("toml", "python"):
            yield block
        elif block.language == "sh":
            lines = list(_commands(block))
            shown = after is not None and after.language == ""
            said = tuple(after.text.splitlines()) if after is not None and shown else ()
            yield from lines[:-1]
            yield from (line._replace(said=said) for line in lines[-1:])


def _commands(block: Snippet) -> Iterator[Command]:
    for match in _VERB.finditer(block.text):
        status = _STATUS.search(match[1])
        words = tuple(shlex.split(_STATUS.sub("", match[1])))
        yield Command(block.where, words, int(status[1]) if status else 0)


def write(folder: Path, block: Snippet) -> None:
    """Write the file of a block, or its part."""
    head = _FILE.match(block.text)
    assert head, f"{block.where}: the first line doesn't name a file"
    file, part = folder / head[1], head[2]
    text = block.text[head.end() :]
    if part is None:
        file.write_text(text)
    elif part == "at its end":
        file.write_text(f"{file.read_text()}\n{text}")
    else:
        table = re.compile(rf"^{re.escape(part)}.*?(?=^\[)", re.MULTILINE | re.DOTALL)
        old = file.read_text()
        assert len(table.findall(old)) == 1, block.where
        file.write_text(table.sub(f"{text}\n", old))


def do(folder: Path, command: Command) -> None:
    """Do a command in this process; a run of which nothing is shown is a short one."""
    words = command.words
    if words[0] == "run":
        words += _IN_PROCESS if command.said else (*_IN_PROCESS, *_SHORT)
    done = fleetloop(folder, *words)
    where = f"{command.where}: {' '.join(words)}:\n{done.stdout}{done.stderr}"
    assert done.returncode == command.status, where
    printed = [" ".join(line.split()) for line in done.stdout.splitlines()]
    for line in command.said:
        assert " ".join(line.split()) in " ".join(printed), f"{where}\nmissing: {line}"
