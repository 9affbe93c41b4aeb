"""A robot's law from its brief: built, and for one of the user's own, its answers checked.

A shipped law is called as it is. Of any other each answer is checked before anything else uses it,
and an error in `hold` or a wrong number of signals is an error of the law, at the tick at which it
happens.
"""

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any, NamedTuple

from agents.laws.failure import LawError, number, raised
from agents.laws.interface import (
    Law,
    LawOutput,
    PathVariable,
    Reference,
    RobotMotion,
    RobotPath,
    Signal,
    Wheels,
)
from agents.laws.path_errors import errors_of
from configs.errors import ScenarioError
from configs.plugins import LAWS, Choice
from configs.signals import gives_path_errors

Step = Callable[[Any, RobotMotion, Reference, PathVariable], LawOutput]


class BuiltLaw(NamedTuple):
    """A law as the controller calls it."""

    step: Step
    hold: Callable[[Any, Any], Any]
    signals: int  # values of each step, path errors (8) among them


def build(
    choice: Choice,
    wheels: Wheels,
    period_s: float,
    path: RobotPath,
    note: Callable[[str], None] = lambda _: None,
) -> BuiltLaw:
    """The law of a robot; `note` is told once when a signal of a user's own law is not finite.

    Raises:
        ScenarioError: it can't be had, or raises when it is made.
    """
    kind = choice.load()
    try:
        law: Law = kind(choice.parameters, wheels, period_s, path)
    except (Exception, SystemExit) as error:
        raise ScenarioError(f"control.law = {choice.name}: {raised(error)}") from error
    if choice.name in LAWS:
        return BuiltLaw(law.step, law.hold, len(kind.SIGNALS))
    return _checked(law, kind.SIGNALS, lambda text: note(f"law {choice.name}: {text}"))


def _checked(law: Law, table: Sequence[Signal], note: Callable[[str], None]) -> BuiltLaw:
    """A law of the user's own; (8) is put before its signals unless it gives the errors itself."""
    expected, adds = len(table), not gives_path_errors(table)
    failed = ""  # by `hold`, said at the next step
    noted = False

    def step(
        state: Any, motion: RobotMotion, reference: Reference, along: PathVariable
    ) -> LawOutput:
        nonlocal noted
        if failed:
            raise LawError(failed)
        out = law.step(state, motion, reference, along)
        try:
            right, left, after, signals = out
            values = tuple(map(number, signals))
            right, left = number(right), number(left)
        except (TypeError, ValueError) as error:
            raise LawError(
                "step must return (tau_right, tau_left, state, signals), numbers but the state;"
                f" it returned {out!r:.80}"
            ) from error
        if len(values) != expected:
            raise LawError(f"step returned {len(values)} signals, SIGNALS has {expected}")
        if not noted and not all(map(isfinite, values)):
            noted = True
            note(_not_finite(table, values))
        if adds:
            return LawOutput(right, left, after, (*errors_of(motion, reference), *values))
        return LawOutput(right, left, after, values)

    def hold(before: Any, after: Any) -> Any:
        nonlocal failed
        try:
            return law.hold(before, after)
        except (Exception, SystemExit) as error:
            failed = f"in hold: {raised(error)}"
            return before

    return BuiltLaw(step, hold, expected + 3 * adds)


def _not_finite(table: Sequence[Signal], values: Sequence[float]) -> str:
    each = [
        f"{signal.name} = {value:g}"
        for signal, value in zip(table, values, strict=True)
        if not isfinite(value)
    ]
    return f"recorded as not finite: {', '.join(each)}"
