"""Paths that files and options name."""

import os
from pathlib import Path
from stat import S_ISREG

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


def text_of(path: Path, what: str, most_bytes: int) -> str:
    """The text of a regular file in UTF-8, without a mark of byte order.

    Pipes and devices are refused: reading them may wait for ever, or never end.

    Args:
        path: of the file; `~` is replaced.
        what: names the setting in messages.
        most_bytes: a longer file is refused.

    Raises:
        ScenarioError: the file can't be read, is none, is too long or isn't text.
    """
    path = expanded(path, what)
    try:
        with open(path, "rb", opener=_without_waiting) as file:
            if not S_ISREG(os.fstat(file.fileno()).st_mode):
                raise ScenarioError(f"{path}: must be a regular file, not a pipe or a device")
            read = file.read(most_bytes + 1)
    except OSError as error:
        raise ScenarioError(f"{path}: can't be read: {error.strerror or error}") from error
    if len(read) > most_bytes:
        raise ScenarioError(f"{path}: larger than {most_bytes >> 10} KiB")
    try:
        return read.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: no text in UTF-8") from error


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)
