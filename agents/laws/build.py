"""A robot's law from its brief: built, and for one of the user's own, its answers checked.

A shipped law is called as it is. Of any other each answer is checked before anything else uses it,
and an error in `hold` or a wrong number of signals is an error of the law, at the tick at which it
happens.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from agents.laws.dsc_terms import path_errors
from agents.laws.failure import LawError, failure, number
from agents.laws.interface import (
    Law,
    LawOutput,
    PathVariable,
    Reference,
    RobotMotion,
    RobotPath,
    Wheels,
)
from configs.errors import ScenarioError
from configs.plugins import LAWS, Choice
from configs.signals import gives_path_errors

Step = Callable[[Any, RobotMotion, Reference, PathVariable], LawOutput]


class BuiltLaw(NamedTuple):
    """A law as the controller calls it."""

    step: Step
    hold: Callable[[Any, Any], Any]
    signals: int  # values of each step, path errors (8) among them


def build(choice: Choice, wheels: Wheels, period_s: float, path: RobotPath) -> BuiltLaw:
    """The law of a robot.

    Raises:
        ScenarioError: it can't be had, or raises when it is made.
    """
    kind = choice.load()
    try:
        law: Law = kind(choice.parameters, wheels, period_s, path)
    except (Exception, SystemExit) as error:
        raise ScenarioError(f"control.law = {choice.name}: {failure(error)[1]}") from error
    if choice.name in LAWS:
        return BuiltLaw(law.step, law.hold, len(kind.SIGNALS))
    return _checked(law, len(kind.SIGNALS), adds=not gives_path_errors(kind.SIGNALS))


def _checked(law: Law, expected: int, *, adds: bool) -> BuiltLaw:
    """A law of the user's own; `adds`: the errors (8) are put before its signals."""
    failed = ""  # by `hold`, said at the next step

    def step(
        state: Any, motion: RobotMotion, reference: Reference, along: PathVariable
    ) -> LawOutput:
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
        if adds:
            errors = path_errors(*motion[:3], *reference[:3])
            return LawOutput(right, left, after, (*errors, *values))
        return LawOutput(right, left, after, values)

    def hold(before: Any, after: Any) -> Any:
        nonlocal failed
        try:
            return law.hold(before, after)
        except (Exception, SystemExit) as error:
            failed = f"in hold: {failure(error)[1]}"
            return before

    return BuiltLaw(step, hold, expected + 3 * adds)
