"""The page of the commands, from the tree of verbs, and of the exit statuses."""

import ast
import inspect
import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import typer

from configs.errors import ExitStatus
from docs.generate.markdown import prose, table
from fleetloop.cli import app

_ARGUMENT_TYPE = re.compile(r" <.*>$")


def commands_page() -> str:
    """Every verb with its arguments and options."""
    root: Any = typer.main.get_command(app)
    parts = [_verb(words, verb) for words, verb in _verbs(("fleetloop",), root)]
    return "\n".join([f"## Exit status\n\n{_statuses()}", *parts])


def _verbs(words: tuple[str, ...], verb: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
    inner = getattr(verb, "commands", None)
    if inner is None:
        yield words, verb
        return
    for name, below in sorted(inner.items()):
        if not below.hidden:
            yield from _verbs((*words, name), below)


def _verb(words: tuple[str, ...], verb: Any) -> str:
    context = verb.make_context(words[-1], [], resilient_parsing=True)
    shown = [param for param in verb.params if not getattr(param, "hidden", False)]
    usage = [piece.strip("{}") for param in shown for piece in param.get_usage_pieces(context)]
    records = filter(None, (param.get_help_record(context) for param in shown))
    rows = [(f"`{_ARGUMENT_TYPE.sub('', spelled)}`", _text(said)) for spelled, said in records]
    paragraphs = prose(_text(verb.help or ""))
    title = " ".join(words)
    arguments = table(("argument", ""), rows)
    return f"## {title}\n\n{paragraphs}\n\n`{' '.join([title, *usage])}`\n\n{arguments}"


def _text(words: str) -> str:
    """Help without the terminal's markup."""
    return inspect.cleandoc(words).replace(r"\[", "[")


def _statuses() -> str:
    """The members of `ExitStatus` with the texts below them in its source."""
    (source,) = ast.parse(inspect.getsource(ExitStatus)).body
    if not isinstance(source, ast.ClassDef):
        raise TypeError(f"{ExitStatus}: no class in its source")
    rows = []
    for member, said in pairwise(source.body):
        if isinstance(member, ast.Assign) and isinstance(said, ast.Expr):
            name = ast.unparse(member.targets[0])
            rows.append((f"{ExitStatus[name]:d}", name.lower(), str(ast.literal_eval(said.value))))
    return table(("status", "name", ""), rows)
