"""docs/python.md is one session that works, and so is what the README shows of it."""

import ast
import re
from pathlib import Path
from typing import Any

import pytest
from support.snippets import Snippet, snippets

import fleetloop

BLOCKS = [s for s in snippets("python", "text") if s.where.startswith("docs/python.md:")]
SESSION = [s for s in BLOCKS if s.language == "python" and not s.text.startswith("# test_")]
SAID = next(s for s in BLOCKS if s.language == "text")
README = [
    s for s in snippets("python") if s.where.startswith("README") and "fleetloop.run" in s.text
]
TESTS = [s for s in BLOCKS if s.text.startswith("# test_")]


def test_the_session_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    values = []
    for block in SESSION:
        *lines, last = ast.parse(block.text).body
        exec(compile(ast.Module(lines, []), block.where, "exec"), names)
        if isinstance(last, ast.Expr):
            values.append(eval(ast.unparse(last.value), names))
        else:
            exec(ast.unparse(last), names)
    assert repr(values[0]).startswith("Scenario('two_robots', robots=2")
    assert any(isinstance(value, fleetloop.Run) and value.held for value in values)
    said = capsys.readouterr().out
    shown = re.escape(SAID.text.strip()).replace(re.escape("..."), "[^)]*")
    assert re.search(shown, said), said
    assert "[(1.0, 'r2', 'fault_applied'), (1.2, 'r2', 'fault_cleared')]" in said
    assert said.count("held, settled after") == 3
    assert (tmp_path / "errors.png").stat().st_size > 10_000


@pytest.mark.parametrize("block", TESTS, ids=lambda block: block.where)
def test_the_test_passes(block: Snippet, fleetloop_run) -> None:
    names: dict[str, Any] = {}
    exec(compile(block.text, block.where, "exec"), names)
    (test,) = (value for name, value in names.items() if name.startswith("test_"))
    test(fleetloop_run)


@pytest.mark.parametrize("block", README, ids=lambda block: block.where)
def test_the_example_of_the_readme_holds(
    block: Snippet,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(block.text, block.where, "exec"), {})
    assert re.fullmatch(r"held [\d.]+ m [\d.e-]+\n", capsys.readouterr().out)
    assert (tmp_path / "positions.png").stat().st_size > 10_000
