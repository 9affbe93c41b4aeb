"""What the packages import is what pyproject.toml declares, no more and no less."""

import ast
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GENERATED = {"numba"}
"""Imported by the module that `fleetloop.sweep.kernel.compilation` writes."""
OURS = ("agents", "bridge", "configs", "fleetloop", "plant")


def imported() -> set[str]:
    names = set(GENERATED)
    for package in OURS:
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.Import):
                    names |= {alias.name.partition(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    names.add(node.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - set(OURS)


def test_every_import_is_a_declared_dependency_and_every_dependency_is_imported() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = (text for texts in project["optional-dependencies"].values() for text in texts)
    declared = {text.partition(">")[0] for text in (*project["dependencies"], *extras)}
    distributions = packages_distributions()
    used = {distributions[name][0].lower().replace("_", "-") for name in imported()}
    assert used == declared


def test_ci_runs_the_test_command_of_the_readme() -> None:
    readme = (ROOT / "README.md").read_text("utf-8").splitlines()
    (command,) = [line for line in readme if line.endswith("uv run --group dev ./test.sh")]
    assert (ROOT / ".ci" / "run").read_text("utf-8").splitlines()[-1] == command
