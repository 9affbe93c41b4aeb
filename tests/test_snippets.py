"""Every scenario, deployment and command in README and docs is one that Fleetloop takes."""

import re
import tomllib
from pathlib import Path

import pytest
import typer
from support.snippets import Snippet, commands, snippets

from configs.deployment import check_deployment
from configs.loading import load, loads
from fleetloop.cli import app
from fleetloop.sweep import study as studies
from fleetloop.sweep.app import StudyFirst
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.plan import Base, Plan
from fleetloop.tune import tuning as tunings
from fleetloop.tune.plan import TuningPlan

HEAD = 'schema = 1\nname = "shown"\n'
FLEET = "".join(
    f'[[robot]]\nname = "r{n}"\npose = {{ x_m = 0.0, y_m = {n}.0 }}\n' for n in (1, 2, 3)
)
BASE = Base.beside("shown.toml", "two_robots")
UsageError = typer.BadParameter.__base__ or Exception


ELSEWHERE = ("own", "pyproject", "fleet", "flower", "drives")
"""Files that tests/system/test_own_laws.py and tests/docs/test_pages.py write and run."""
TABLES = [
    one
    for one in snippets("toml")
    if not one.text.startswith(tuple(f"# {name}.toml" for name in ELSEWHERE))
]


@pytest.mark.parametrize("snippet", TABLES, ids=lambda s: s.where)
def test_files_that_are_shown_are_taken(snippet: Snippet, tmp_path: Path) -> None:
    data = tomllib.loads(snippet.text)
    if "parameter" in data:
        tuning = tunings.loads("shown.toml", snippet.text)
        TuningPlan(tuning, Base.beside("shown.toml", tuning.base)).check("shown.toml")
        return
    if "factor" in data:
        Cases(Plan(studies.loads("shown.toml", snippet.text).to_toml(), BASE))
        return
    placed = "roles" in data or isinstance(data.get("robot"), dict)
    if placed or "endpoint" in data.get("network", ()):
        for name in re.findall(r'"([\w./-]+\.(?:pem|key))"', snippet.text):
            (tmp_path / name).touch()
        check_deployment("shown", data, load("two_robots_100hz"), tmp_path)
    else:
        loads("shown", HEAD + snippet.text + FLEET)


def _takes_argument(command) -> bool:
    return any(param.param_type_name == "argument" for param in command.params)


def test_commands_that_are_shown_are_understood() -> None:
    root = typer.main.get_command(app)
    seen = 0
    for where, words in commands():
        command = root
        name, *rest = words
        while (known := getattr(command, "commands", {})) and rest:
            if rest[0] not in known and isinstance(command, StudyFirst):
                rest = ["run", *rest]
            if rest[0][0] == "-":
                break
            if rest[0] not in known and _takes_argument(command):
                rest = rest[1:]  # the verb's own argument, as a run, before the next verb
                continue
            assert rest[0] in known, f"{where}: {' '.join(words)}: no such verb"
            command, name, rest = known[rest[0]], rest[0], rest[1:]
        # Verbs named in passing come without their arguments.
        if rest and known:
            assert any(rest[0] in param.opts for param in command.params), f"{where}: {words}"
        elif rest:
            try:
                command.make_context(name, list(rest))
            except UsageError as error:
                pytest.fail(f"{where}: {' '.join(words)}: {error.format_message()}")
        seen += 1
    assert seen > 30


OURS = re.compile(r"(\.uv/bin/)?(uv run )?fleetloop |python host\.py( --channel r2|  )")
"""Also what tests/examples runs."""
PLACES = re.compile(r"\. \.venv/bin/activate$|mkdir \S+ && cd \S+$")


def test_a_line_of_shell_that_no_test_runs_has_a_reason_on_its_page() -> None:
    blocks = snippets("sh")
    for block in blocks:
        others = [
            it for it in block.text.splitlines() if not OURS.match(it) and it and it[0] != "#"
        ]
        others = [line for line in others if not PLACES.match(line)]
        why = "put <!-- not run: REASON --> before it" if others else "take its reason away"
        assert bool(others) == bool(block.not_run), f"{block.where}: {others}: {why}"


def test_few_blocks_are_not_run() -> None:
    everything = snippets("sh", "python", "toml")
    assert len(everything) > 60
    assert sum(bool(block.not_run) for block in everything) <= 10
