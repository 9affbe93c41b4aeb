"""Values of options: bounds, and messages in this program's wording."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import typer
from typer.core import TyperGroup

LONGEST_S = 1e9
FASTEST, SLOWEST = 1e6, 1e-6
"""Multiples of real time."""


class OurWords(TyperGroup):
    """Verbs whose options say in our words why a value is none, whatever has read it."""

    def invoke(self, ctx: Any) -> Any:
        """Run a verb."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            from pydantic import ValidationError

            from configs.complaints import in_words

            if isinstance(cause := error.__cause__, ValidationError):
                value = cause.errors(include_url=False)[0]["input"]
                error.message = f"{value}: {in_words(cause)}."
            raise


class RunFirst(OurWords):
    """Verbs before which a run may be named."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Without a run before its verb, it is the only one that goes on."""
        if args and args[0] in self.commands:
            args = ["", *args]
        return super().parse_args(ctx, args)


def between(least: float, most: float) -> Callable[[float | None], float | None]:
    """A check of an option's value: at least and at most this."""

    def check(value: float | None) -> float | None:
        if value is not None and not least <= value <= most:  # not a number is neither
            raise typer.BadParameter(f"{value:g}: must be a number from {least:g} to {most:g}.")
        return value

    return check


def above_zero(most: float) -> Callable[[float | None], float | None]:
    """A check of an option's value: more than 0 and at most this."""

    def check(value: float | None) -> float | None:
        if value is not None and not 0.0 < value <= most:  # not a number is neither
            raise typer.BadParameter(f"{value:g}: must be more than 0 and at most {most:g}.")
        return value

    return check


def finite(value: float | None) -> float | None:
    """A check of an option's value: a number."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"{value:g}: must be a finite number.")
    return value


def speed(value: float) -> float:
    """A check of a multiple of real time; 0: as fast as can be."""
    if value and not SLOWEST <= value <= FASTEST:
        remedy = f"must be 0 (as fast as the machine allows), or from {SLOWEST:g} to {FASTEST:g}."
        raise typer.BadParameter(f"{value:g}: {remedy}")
    return value


def seeds(texts: Sequence[str]) -> tuple[int, ...]:
    """Seeds from their texts, each once; their bounds are the scenario's."""
    wrong = next((text for text in texts if not text.isdecimal()), None)
    if wrong is not None:
        raise typer.BadParameter(f"{wrong}: a seed is a whole number, 0 or more.")
    return tuple(dict.fromkeys(map(int, texts)))
