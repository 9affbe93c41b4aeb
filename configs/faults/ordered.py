"""Faults that are ordered during a run: held to the same classes and scenario as [[fault]]."""

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, ValidationError

from configs.complaints import complaints, refusal
from configs.errors import Complaint, Problem
from configs.faults.base import Fault
from configs.faults.kinds import KINDS, AnyFault
from configs.faults.plan import problems_of
from configs.parameters import as_tuples
from configs.wording import guess

if TYPE_CHECKING:
    from configs.scenario import Scenario

WHERE = "fault"


class _Order(BaseModel):
    """A file of one fault; its validators are built with the first order."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True
    )
    fault: AnyFault


def ordered_fault(
    table: Mapping[str, Any], scenario: "Scenario", now_s: float, names: Collection[str]
) -> Fault:
    """The fault in a table with the keys of [[fault]]; without `at_s` it begins now.

    Args:
        table: as parsed from JSON or TOML.
        scenario: of the run.
        now_s: scenario time.
        names: of all faults of the run so far.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        hint = guess(str(kind), [*KINDS])
        remedy = f"must be one of {', '.join(KINDS)}{hint}"
        raise refusal([Complaint(WHERE, "kind", kind, remedy)])
    data = {WHERE: {"at_s": now_s, **table}}
    try:
        fault = _Order.model_validate(as_tuples(data)).fault
    except ValidationError as error:
        raise refusal([_told(one) for one in complaints(error, data, _Order)]) from error
    problems = list(problems_of(fault, WHERE, scenario))
    if fault.at_s < now_s:
        remedy = f"has gone: the run is at {now_s:.3f} s; leave it out for now"
        problems.append(Problem("at_s", fault.at_s, remedy))
    if fault.name in names:
        problems.append(Problem("name", fault.name, "another fault of this run has this name"))
    if problems:
        raise refusal([_told(one) for one in problems])
    return fault


def _told(problem: Problem) -> Complaint:
    return Complaint(WHERE, problem.key.removeprefix(f"{WHERE}."), problem.value, problem.remedy)
