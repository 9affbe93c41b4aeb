"""A campaign as it is asked for: its scenario, its matrix, its conditions."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import typer

from configs.errors import Complaint, ScenarioError
from configs.faults.kinds import KINDS, class_of
from configs.overrides import Override
from configs.scenario import Scenario
from fleetloop import numbers
from fleetloop.campaign.matrix import Conditions

MOST_CELLS = 100_000
ALL = "all"


@dataclass(frozen=True, slots=True)
class Plan:
    """A campaign."""

    source: str
    given: tuple[str, ...]
    """What `--set` changes of the scenario."""
    kinds: tuple[str, ...]
    times_s: tuple[float, ...]
    seeds: tuple[int, ...]
    conditions: Conditions
    in_process: bool
    """Kinds that need processes are refused."""
    limit_s: float
    """Longest wall time of a cell."""

    def as_table(self) -> dict[str, Any]:
        """For a file."""
        return asdict(self)

    @classmethod
    def from_table(cls, table: dict[str, Any]) -> "Plan":
        """The plan again.

        Raises:
            KeyError, TypeError: it is none.
        """
        shared = table["conditions"]
        lists = {key: tuple(table[key]) for key in ("given", "kinds", "times_s", "seeds")}
        conditions = Conditions(**{**shared, "robots": tuple(shared["robots"])})
        return cls(**{**table, **lists, "conditions": conditions})


def kinds_named(text: str) -> tuple[str, ...]:
    """The kinds of `--faults`: all, or those named.

    Raises:
        ScenarioError: there is no such kind.
    """
    names = tuple(dict.fromkeys(filter(None, map(str.strip, text.split(",")))))
    if names == (ALL,):
        return tuple(KINDS)
    for name in names:
        try:
            class_of(name)
        except ScenarioError as error:
            raise ScenarioError(f"--faults: {error}") from None
    if not names:
        raise ScenarioError(f"--faults {text!r}: names no kind; all, or for example push,bus_cut")
    return names


def times_named(text: str, scenario: Scenario) -> tuple[float, ...]:
    """The times of `--at`: FROM:TO:STEP with both ends, or a list [s].

    Raises:
        typer.BadParameter: it is neither, or a time isn't within the scenario.
    """
    found = _times(text)
    if not found or len(found) > MOST_CELLS:
        remedy = "must read FROM:TO:STEP with FROM up to TO, as 5:25:5, or a list, as 5,10.5"
        raise typer.BadParameter(f"--at {text}: {remedy} [s].")
    for t_s in found:
        if not 0 <= t_s < scenario.duration_s:
            remedy = f"must be below its duration_s = {scenario.duration_s:g}"
            raise typer.BadParameter(f"--at {text}: {scenario.name} at {t_s:g} s: {remedy}.")
    return tuple(dict.fromkeys(found))


def _times(text: str) -> list[float]:
    """The times; none of a text that is none."""
    parts = text.split(":")
    try:
        numbers_of = [float(part) for part in (parts if len(parts) > 1 else text.split(","))]
    except ValueError:
        return []
    if len(parts) == 1:
        return numbers_of
    if len(parts) != 3 or not all(map(isfinite, numbers_of)):
        return []
    first, last, step = numbers_of
    if step <= 0 or last < first or (last - first) / step > MOST_CELLS:
        return []
    return [round(first + n * step, 9) for n in range(int((last - first) / step + 1e-9) + 1)]


def seeds_named(text: str | None, first: int) -> tuple[int, ...]:
    """The seeds of `--seeds`: so many from the scenario's on, or a list.

    Raises:
        typer.BadParameter: it is neither.
    """
    texts = [part.strip() for part in (text or "1").split(",")]
    seeds = numbers.seeds(texts)
    if len(texts) > 1:
        return seeds
    if not 1 <= seeds[0] <= MOST_CELLS:
        raise typer.BadParameter(f"--seeds {text}: so many seeds, 1 or more, or a list, as 3,7.")
    return tuple(range(first, first + seeds[0]))


def robots_named(names: Sequence[str], scenario: Scenario) -> tuple[str, ...]:
    """The robots of `--robots`: the first of the scenario if none is named.

    Raises:
        ScenarioError: there is no such robot.
    """
    for name in names:
        if name not in scenario.names:
            known = ", ".join(scenario.names)
            raise ScenarioError(
                f"--robots {','.join(names)}: {name}: no such robot; known: {known}"
            )
    return tuple(dict.fromkeys(names)) or scenario.names[:1]


def parameters_named(texts: Sequence[str], kinds: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The parameters of `--param KIND.KEY=VALUE`, by kind.

    Raises:
        ScenarioError: one reads differently, or its kind isn't in the campaign.
    """
    found: dict[str, dict[str, Any]] = {}
    for text in texts:
        one = Override.from_set(text)
        kind, _, key = ("", "", "") if isinstance(one, Complaint) else one.key.partition(".")
        if isinstance(one, Complaint) or not key or "." in key:
            raise ScenarioError(
                f"--param {text}: must read KIND.KEY=VALUE, as push.force_body_N=20"
            )
        if kind not in kinds:
            known = ", ".join(kinds)
            raise ScenarioError(f"--param {text}: {kind} is not in --faults; there are: {known}")
        if key in ("kind", "at_s", "name"):
            raise ScenarioError(f"--param {text}: the campaign sets {key}")
        found.setdefault(kind, {})[key] = one.value
    return found
