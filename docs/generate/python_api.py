"""The page of `import fleetloop`: its names with their signatures and docstrings."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from typing import Any

import fleetloop
from docs.generate.markdown import doc_block


def python_page() -> str:
    """Every public name of the package."""
    parts = []
    for name in sorted(fleetloop.__all__, key=_rank):
        found: Any = getattr(fleetloop, name)
        parts.append(f"## `fleetloop.{name}`\n\n{_about(found)}")
        if inspect.isclass(found):
            parts += [f"### `{name}.{member}`\n\n{_about(of)}" for member, of in _members(found)]
    return "\n\n".join(parts)


def _rank(name: str) -> int:
    """Functions come first, errors last."""
    found = getattr(fleetloop, name)
    return 0 if not inspect.isclass(found) else 1 + issubclass(found, Exception)


def _members(of: type) -> Iterator[tuple[str, Any]]:
    """Public functions and properties that a class of ours defines and describes itself."""
    for name, member in vars(of).items():
        function = _function(member)
        if not name.startswith("_") and function is not None and function.__doc__:
            yield name, member


def _function(member: Any) -> Any:
    """The function behind a method or a property, None if there is none."""
    behind = getattr(member, "__func__", None) or getattr(member, "fget", None)
    behind = behind or getattr(member, "func", None) or member
    return behind if inspect.isfunction(behind) else None


def _about(of: Any) -> str:
    """Signature, of a function, and docstring."""
    function = _function(of)
    if function is None:
        return doc_block(of)
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    if not isinstance(node, ast.FunctionDef):
        raise TypeError(f"{function}: no function in its source")
    gives = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    if function is of:
        called = f"{node.name}({ast.unparse(node.args)}){gives}"
    else:  # a property is read, not called
        called = f"{node.name}{gives.replace(' ->', ':')}"
    return f"```text\n{called}\n\n{inspect.getdoc(function)}\n```"
