"""Paths that files and options name."""

from pathlib import Path

from configs.errors import ScenarioError


def expanded(path: Path, what: str) -> Path:
    """The path with `~` and `~user` replaced; `what` names the setting in messages.

    Raises:
        ScenarioError: there is no such user, or no file can have such a name.
    """
    if "\0" in str(path):
        raise ScenarioError(f"{what} = {str(path)!r}: no file has a zero byte in its name")
    try:
        return path.expanduser()
    except RuntimeError as error:
        raise ScenarioError(f"{what} = {path}: no such user, or none with a home") from error
