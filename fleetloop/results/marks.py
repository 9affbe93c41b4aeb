"""What is marked on every time axis: faults with their windows, stops and other events."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from configs.events import KINDS, Gravity
from configs.faults.kinds import KINDS as FAULT_KINDS
from configs.faults.plan import planned_faults
from configs.scenario import Scenario
from fleetloop.results.summary import Summary

STATES = {True: "held", False: "failed", None: "open"}
"""Of an expectation, by `held`: a key of `palette.MARKS`."""
MOST_TARGETS = 8
"""That are named of a fault."""


class FaultMark(NamedTuple):
    """A fault, from its beginning to its end or that of the run."""

    name: str
    from_s: float
    to_s: float
    text: str


class EventMark(NamedTuple):
    """An event."""

    t_s: float
    source: str
    kind: str
    text: str
    bad: bool


class Marks(NamedTuple):
    """All of a run."""

    faults: list[FaultMark]
    events: list[EventMark]


def marks_of(summary: Summary, scenario: Scenario, end_s: float) -> Marks:
    """The marks of a run that went on to `end_s`."""
    faults = list(_faults(summary, end_s)) or list(_planned(scenario, end_s))
    return Marks(faults, list(_events(summary)))


def state_of(expect: dict[str, Any]) -> str:
    """Of an expectation as in the summary."""
    return STATES[expect["held"]]


def _faults(summary: Summary, end_s: float) -> Iterator[FaultMark]:
    for row in summary.get("faults", []):
        how = f"fault {row['name']}: {row['kind']} on {_listed(row['targets'])}"
        how += ", ordered" if row.get("ordered") else ""
        yield _fault(row["name"], row["kind"], how, row["from_s"], row["to_s"], end_s)


def _planned(scenario: Scenario, end_s: float) -> Iterator[FaultMark]:
    """As the scenario has them, of a run that left no summary."""
    period_s = scenario.clock.control_period_s
    targets: dict[str, list[str]] = {}
    found = {}
    for name, target, fault, first, last in planned_faults(scenario):
        targets.setdefault(name, []).append(target)
        found[name] = fault.kind, first * period_s, None if last is None else last * period_s
    for name, (kind, from_s, to_s) in found.items():
        how = f"fault {name}: {kind} on {_listed(targets[name])}"
        yield _fault(name, kind, how, from_s, to_s, end_s)


def _listed(targets: Sequence[str]) -> str:
    more = len(targets) - MOST_TARGETS
    return ", ".join(targets[:MOST_TARGETS]) + (f" and {more} more" if more > 0 else "")


def _fault(
    name: str, kind: str, how: str, from_s: float, to_s: float | None, end_s: float
) -> FaultMark:
    known = FAULT_KINDS.get(kind)  # None: of another version
    if known is not None and known.INSTANT:
        to_s = from_s
    until_s = end_s if to_s is None else to_s
    until = "to the end" if to_s is None else f"to {until_s:.6g} s"
    when = f"from {from_s:.6g} s {until}" if until_s > from_s else f"at {from_s:.6g} s"
    return FaultMark(name, from_s, min(until_s, end_s), f"{how}, {when}")


def _events(summary: Summary) -> Iterator[EventMark]:
    for row in summary.get("events", []):
        t_s, source, kind = row["t_s"], row["source"], row["kind"]
        known = KINDS.get(kind)  # None: of another version
        if known is None or known.told or t_s >= 0.0:
            bad = known is not None and known.gravity > Gravity.INFO
            said = ": ".join(filter(None, (source, kind, row["text"])))
            yield EventMark(t_s, source, kind, f"{said}, at {t_s:.6g} s", bad)
