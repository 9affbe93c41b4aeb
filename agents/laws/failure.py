"""Errors of laws and shapes of the user's own, in words that name the file and the line."""

import traceback
from pathlib import Path
from typing import SupportsFloat

DIVERGED = (ArithmeticError, ValueError)
"""Exceptions of arithmetic that diverges: overflow, division by zero, the sine of infinity."""


class LawError(TypeError):
    """A law's answer is none; the text says why."""


class ShapeError(TypeError):
    """A path shape or a formation offset raises or gives no jet; the text says which, and why."""


def failure(error: BaseException, law: str) -> tuple[str, str]:
    """What became of a path or the law of this name, and the error that it raised.

    Arithmetic of Fleetloop's own code raises where the motion diverges; of other code it isn't
    known why it raises, whatever the type of the error.
    """
    if isinstance(error, ShapeError):
        return "the path failed", str(error)
    if isinstance(error, LawError):
        return f"law {law} failed", str(error)
    if isinstance(error, DIVERGED) and not place_of(error):
        return f"law {law} diverged", str(error)
    return f"law {law} failed", raised(error)


def raised(error: BaseException) -> str:
    """An error with the place that raised it."""
    text = f": {error}" if str(error) else ""
    return f"{place_of(error)}{type(error).__name__}{text}"


def place_of(error: BaseException) -> str:
    """File and line that raised an error, "" if they are Fleetloop's."""
    frames = traceback.extract_tb(error.__traceback__)
    if not frames or frames[-1].filename.startswith(_OURS):
        return ""
    return f"{frames[-1].filename}, line {frames[-1].lineno}: "


def number(value: SupportsFloat) -> float:
    """A number of any type as a float.

    Raises:
        TypeError: it is none; a text of digits isn't either.
        ValueError: it has no value as a float.
    """
    if isinstance(value, (str, bytes, bytearray)):
        raise TypeError(f"{value!r:.80} is no number")
    return float(value)


_OURS = (str(Path(__file__).parents[1]), "agents/")
"""Compiled, a module has its path from the root of the sources."""
