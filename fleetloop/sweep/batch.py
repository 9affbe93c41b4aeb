"""Cases to rows: each by the batch kernel if that can do it, else by the in-process reference.

Both bring the same record; which one it was, and why not the kernel, is in the row. Nothing that is
wrong with one case touches another: values that make no valid scenario, or a law that fails, are
the row of that case.

    invalid    its values make no valid scenario
    error      it brought no result: an exception, or too much time
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple, Protocol

from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop
from configs.errors import FleetloopError
from configs.events import Event
from configs.scenario import Scenario
from fleetloop.in_process.whole import run_in_memory
from fleetloop.record.reader import Record
from fleetloop.sweep.cases import Case, Cases
from fleetloop.sweep.dataset import Row
from fleetloop.sweep.watch import OverdueError, Watch

KERNEL, REFERENCE = "kernel", "in process"
NO_KERNEL = "the batch kernel isn't there"
AT_ONCE = 16
"""Cases whose records the kernel brings together: their rows take memory."""


class Brought(Protocol):
    """What a run came to, by whichever engine."""

    @property
    def record(self) -> Record:
        """At least the signals that were asked for."""

    @property
    def stopped(self) -> Mapping[str, str]:
        """Robots that stopped themselves or diverged, and why."""

    @property
    def events(self) -> Sequence[Event]:
        """All of the run."""

    @property
    def left_course(self) -> str:
        """Why the kernel had the reference run it after all; "" if it didn't."""


class Kernel(NamedTuple):
    """The batch kernel: many cases in one call."""

    lacks: Callable[[Scenario], str]
    """Why it can't run a scenario; "" if it can."""
    run: Callable[[Sequence[Scenario], Collection[str], Stop], Sequence[Brought]]


class Valid(NamedTuple):
    """A case with its scenario."""

    case: Case
    scenario: Scenario


@lru_cache(maxsize=1)
def kernel_here() -> Kernel | None:
    """The batch kernel, if it and its compiler are installed."""
    name = "fleetloop.sweep.kernel"
    if find_spec(name) is None:
        return None
    try:
        module = import_module(name)
    except ImportError:
        return None
    return Kernel(module.lacks, module.run)


def rows_of(
    cases: Cases, numbers: Sequence[int], watch: Watch, kernel: Kernel | None = None
) -> list[Row]:
    """The rows of these cases, in this order.

    Args:
        cases: of the study.
        numbers: of the cases.
        watch: bounds their wall time.
        kernel: the batch kernel, if it is to be used.
    """
    rows: dict[int, Row] = {}
    valid: list[Valid] = []
    for number in numbers:
        case = cases.case(number)
        try:
            valid.append(Valid(case, cases.scenario(case)))
        except FleetloopError as error:
            rows[number] = _row(cases, case, "invalid", _one_line(error))
        except Exception as error:
            rows[number] = _row(cases, case, "error", _described(error))
    why_not = {one.case.number: NO_KERNEL if kernel is None else "" for one in valid}
    if kernel is not None:
        why_not = {one.case.number: _lacks(kernel, one.scenario) for one in valid}
        able = [one for one in valid if not why_not[one.case.number]]
        for first in range(0, len(able), AT_ONCE):
            _by_kernel(cases, able[first : first + AT_ONCE], kernel, watch, rows, why_not)
    for one in valid:
        if one.case.number not in rows:
            rows[one.case.number] = _by_reference(cases, one, why_not[one.case.number], watch)
    return [rows[number] for number in numbers]


def _lacks(kernel: Kernel, scenario: Scenario) -> str:
    try:
        return kernel.lacks(scenario)
    except Exception as error:
        return f"the kernel failed: {_described(error)}"


def _by_kernel(
    cases: Cases,
    valid: Sequence[Valid],
    kernel: Kernel,
    watch: Watch,
    rows: dict[int, Row],
    why_not: dict[int, str],
) -> None:
    """Add rows; where a case makes the kernel fail, that one has none, and why."""
    began_s = SYSTEM_CLOCK.monotonic_s()
    failure = ""
    brought: Sequence[Brought] = ()
    try:
        scenarios = [one.scenario for one in valid]
        brought = kernel.run(scenarios, cases.quantities.signals, watch.begin(len(valid)))
    except (Exception, OverdueError) as error:
        failure = f"the kernel failed: {_described(error)}"
    if watch.end():
        failure = f"the kernel {watch.reason}"
    if not failure:
        share_s = (SYSTEM_CLOCK.monotonic_s() - began_s) / len(valid)
        for one, outcome in zip(valid, brought, strict=True):
            engine = REFERENCE if outcome.left_course else KERNEL
            row = _judged(cases, one, outcome, engine, outcome.left_course, share_s)
            rows[one.case.number] = row
    elif len(valid) == 1:
        why_not[valid[0].case.number] = failure
    else:
        middle = len(valid) // 2
        for half in (valid[:middle], valid[middle:]):
            _by_kernel(cases, half, kernel, watch, rows, why_not)


def _by_reference(cases: Cases, one: Valid, why_not: str, watch: Watch) -> Row:
    """The row of a case."""
    began_s = SYSTEM_CLOCK.monotonic_s()
    told, outcome = "", None
    try:
        outcome = run_in_memory(one.scenario, watch.begin())
    except (Exception, OverdueError, KeyboardInterrupt) as error:  # the last one is a law's
        told = _one_line(error) if isinstance(error, FleetloopError) else _described(error)
    overdue = watch.end()
    wall_s = SYSTEM_CLOCK.monotonic_s() - began_s
    if outcome is None or overdue:
        told = watch.reason if overdue else told
        row = _row(cases, one.case, "error", told, one.scenario, REFERENCE, wall_s)
        return replace(row, engine_reason=why_not)
    return _judged(cases, one, outcome, REFERENCE, why_not, wall_s)


def _judged(
    cases: Cases, one: Valid, outcome: Brought, engine: str, why_not: str, wall_s: float
) -> Row:
    try:
        found = cases.quantities.find(outcome.record, one.scenario, outcome.stopped, outcome.events)
    except Exception as error:
        told = f"its run can't be judged: {_described(error)}"
        return _row(cases, one.case, "error", told, one.scenario, engine, wall_s)
    return Row(
        one.case.number,
        cases.shown(one.case),
        found.values,
        found.verdict,
        found.reason,
        found.margin,
        engine,
        why_not,
        one.scenario.seed,
        wall_s,
        cases.command(one.case),
    )


def row_without_result(cases: Cases, number: int, verdict: str, reason: str) -> Row:
    """The row of a case that brought nothing."""
    return _row(cases, cases.case(number), verdict, reason)


def _row(
    cases: Cases,
    case: Case,
    verdict: str,
    reason: str,
    scenario: Scenario | None = None,
    engine: str = "",
    wall_s: float = 0.0,
) -> Row:
    shown = cases.shown(case)
    seed = shown.get("seed") if scenario is None else scenario.seed
    return Row(
        case.number,
        shown,
        {},
        verdict,
        reason,
        None,
        engine,
        "",
        seed if isinstance(seed, int) else None,
        wall_s,
        cases.command(case),
    )


def _one_line(error: BaseException) -> str:
    return "; ".join(str(error).splitlines())


def _described(error: BaseException) -> str:
    """An exception that is nobody's message: its kind, its text, where it was raised."""
    place = ""
    trace = error.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        place = f" ({Path(code.co_filename).name}:{trace.tb_lineno})"
        trace = trace.tb_next
    return f"{type(error).__name__}: {_one_line(error)}{place}"
