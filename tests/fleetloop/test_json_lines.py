"""Lines of JSON for programs: what docs/json-lines.md says, whoever reads them, however slowly."""

import json
import os
import re
from pathlib import Path
from threading import Thread
from typing import NamedTuple, TextIO

import pytest
from support.command_line import fleetloop

from fleetloop.json_lines import MOST_UNREAD_BYTES, JsonLines

DOCS = Path(__file__).parents[2] / "docs" / "json-lines.md"
BARE = ("--no-report", "--set", "expect=[]", "--set", "bus.record=[]")


def documented() -> tuple[dict[str, set[str]], set[str]]:
    """The fields of each kind of line of a run, and those of a robot, as the page has them."""
    kinds: dict[str, set[str]] = {}
    page = DOCS.read_text("utf-8")
    run, rest = page.partition("## A run")[2].split("A robot in `robots`")
    kind = ""
    for line in run.splitlines():
        cells = [cell.strip(" `") for cell in line.split("|")[1:-1]]
        if len(cells) == 4 and cells[2] not in ("field", "---"):
            kind = cells[0] or kind
            kinds.setdefault(kind, {"kind"}).add(cells[2])
    robot: set[str] = set()
    for line in rest.partition("##")[0].splitlines():
        if line.startswith("| `"):
            robot.update(re.findall(r"`(\w+)`", line.split("|")[1]))
    return kinds, robot


def documented_of(command: str) -> dict[str, set[str]]:
    """The fields of each kind of line of another command, as the page has them."""
    kinds: dict[str, set[str]] = {}
    of = ""
    for line in DOCS.read_text("utf-8").partition("## Tests, campaigns")[2].splitlines():
        if line.startswith("| ") and "`" in line:
            first, kind, fields, *_ = (cell.strip(" `") for cell in line.split("|")[1:])
            of = first or of
            if of == command:
                kinds[kind] = {"kind", *re.split(r"`, `", fields)}
    return kinds


def lines_of(text: str) -> list[dict]:
    return [json.loads(line) for line in text.splitlines()]


def test_a_run_says_what_the_page_promises_and_its_outcome_last(tmp_path) -> None:
    folder = str(tmp_path / "run")
    done = fleetloop(
        tmp_path,
        *("run", "two_robots", "--in-process", "--duration", "0.6", "--json-lines"),
        *("--out", folder, *BARE),
    )
    lines = lines_of(done.stdout)
    kinds, robot = documented()
    assert done.returncode == 0
    assert done.stderr == ""
    assert {line["kind"] for line in lines} | {"note"} == kinds.keys()
    for line in lines:
        assert line.keys() == kinds[line["kind"]]
        if line["kind"] == "robots":
            assert [state.keys() for state in line["robots"].values()] == [robot, robot]
    at = {line["kind"]: n for n, line in enumerate(lines)}
    assert at["outcome"] == len(lines) - 1
    started, outcome = lines[at["started"]], lines[-1]["outcome"]
    assert (started["folder"], started["run"], started["processes"]) == (folder, None, [])
    assert outcome["exit_status"] == 0
    assert outcome["folder"] == folder
    armed = [line["source"] for line in lines if line.get("event") == "armed"]
    assert sorted(armed) == ["r1", "r2"]


SHORT = ("--set", "duration_s=1.0", "--set", "expect.0.from_s=0.6", "--set", "expect.1.from_s=0.6")


CELL = (
    "--faults",
    "push",
    "--at",
    "0.3",
    "--for",
    "0.1",
    "--recover-within",
    "0.2",
    "--hold",
    "0.1",
)


@pytest.mark.parametrize(
    "words",
    [
        ("test", "two_robots", *SHORT),
        ("campaign", "two_robots", *CELL, "--out", "out", *SHORT),
        ("plant", "two_robots", "--duration", "0.05"),
    ],
)
def test_other_commands_say_what_the_page_promises(tmp_path, words: tuple[str, ...]) -> None:
    done = fleetloop(tmp_path, *words, "--json-lines")
    lines = lines_of(done.stdout)
    kinds = documented_of(words[0])
    assert done.returncode == 0, done
    assert kinds.keys() - {"note"} == {line["kind"] for line in lines}
    for line in lines:
        assert line.keys() == kinds[line["kind"]]
    assert (lines[0]["kind"], lines[0]["command"]) == ("started", words[0])
    assert (lines[-1]["kind"], lines[-1]["exit_status"]) == ("ended", 0)


def test_a_refused_scenario_has_an_outcome_too(tmp_path) -> None:
    done = fleetloop(tmp_path, "run", "two_robots", "--json-lines", "--set", "control.k1=-1")
    (line,) = lines_of(done.stdout)
    assert (line["kind"], line["outcome"]["verdict"]) == ("outcome", "refused")
    assert done.returncode == line["outcome"]["exit_status"] == 2


def test_one_document_or_lines(tmp_path) -> None:
    done = fleetloop(tmp_path, "run", "two_robots", "--json", "--json-lines")
    assert (done.returncode, done.stdout) == (2, "")
    assert "choose one" in done.stderr


class Pipe(NamedTuple):
    """A stream, and the descriptor from which it is read."""

    stream: TextIO
    read_fd: int


@pytest.fixture
def pipe():
    """A pipe; its reading end is closed by the test."""
    ours, theirs = os.pipe()
    with os.fdopen(theirs, "w", encoding="utf-8") as stream:
        yield Pipe(stream, ours)


def read_all(fd: int) -> bytes:
    read = b""
    while more := os.read(fd, 1 << 16):
        read += more
    return read


def test_a_reader_that_does_not_read_misses_pictures_only(pipe: Pipe) -> None:
    lines = JsonLines(pipe.stream)
    for n in range(3000):
        lines.picture("picture", number=n, weight="x" * 1000)
        if n % 1000 == 0:
            lines.say("event", number=n)
    lines.say("outcome")
    said: list[bytes] = []
    reader = Thread(target=lambda: said.append(read_all(pipe.read_fd)))
    reader.start()
    lines.end()
    pipe.stream.close()
    reader.join(20.0)
    read = lines_of(said[0].decode())
    assert [line["number"] for line in read if line["kind"] == "event"] == [0, 1000, 2000]
    pictures = [line["number"] for line in read if line["kind"] == "picture"]
    assert pictures == list(range(len(pictures)))
    assert 1000 < len(pictures) < 1.2 * MOST_UNREAD_BYTES / 1000
    assert read[-1] == {"kind": "outcome"}


def test_a_closed_reader_is_no_failure(pipe: Pipe) -> None:
    lines = JsonLines(pipe.stream)
    os.close(pipe.read_fd)
    for n in range(10):
        lines.say("event", number=n)
    lines.end()


def test_numbers_that_json_lacks_are_a_mistake_of_ours(pipe: Pipe) -> None:
    with pytest.raises(ValueError, match="JSON"):
        JsonLines(pipe.stream).say("event", number=float("nan"))
    os.close(pipe.read_fd)
