"""The workflow file that users copy."""

import shlex
from pathlib import Path

import typer
import yaml

from fleetloop.cli import app

FILE = Path(__file__).parents[3] / "docs" / "workflows" / "fleetloop.yml"


def test_commands_of_the_workflow_are_understood() -> None:
    workflow = yaml.safe_load(FILE.read_text("utf-8"))
    steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
    runs = [shlex.split(step["run"]) for step in steps if "run" in step]
    ours = [words[1:] for words in runs if words[0] == "fleetloop"]
    root = typer.main.get_command(app)
    for verb, *rest in ours:
        root.commands[verb].make_context(verb, list(rest))
    assert [verb for verb, *_ in ours] == ["test", "campaign", "campaign"]


def test_what_the_workflow_uploads_is_what_its_commands_write() -> None:
    text = FILE.read_text("utf-8")
    assert text.count("--out out/") == text.count("--junit out/") == 3
    assert "path: out/" in text
