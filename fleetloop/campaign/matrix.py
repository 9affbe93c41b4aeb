"""The cells of a campaign: each one fault of a kind, begun at a time, with a seed.

All cells of a campaign have the robots, the duration of the fault and the times of their judgement
in common. An expectation whose window can begin later, as that of a bound which holds from `from_s`
to the end of the run, is asked for

    strictly    from max(at, T) on
    late        from max(at + for, T) + recover on, for as long as `hold` at least

at the fault's begin, for its duration (0 of an instant), T the time from which on the same scenario
without the fault keeps the bound for good, at most its own `from_s`. Any other, with an end of its
own, relative to a fault, of events, or of what holds eventually, stays as it is. A cell ends when
all late windows were long enough.
"""

import shlex
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

from configs.emulated_edges import SOURCES, edges_of
from configs.errors import ScenarioError
from configs.expect import Expect, window_of
from configs.faults.base import Fault
from configs.faults.kinds import KINDS
from configs.faults.messages import LinkFault
from configs.loading import loads, to_toml
from configs.overrides import Override, inline
from configs.scenario import Scenario

NONE = "none"
"""In the place of a kind: the scenario as it is."""


@dataclass(frozen=True, slots=True, order=True)
class Cell:
    """One fault of a kind at a time, with a seed."""

    kind: str
    at_s: float
    seed: int


@dataclass(frozen=True, slots=True)
class Conditions:
    """What all cells of a campaign have in common."""

    robots: tuple[str, ...]
    for_s: float
    recover_s: float
    hold_s: float
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Of kinds, in the place of the kind's defaults."""

    def table(self, kind: str, at_s: float, scenario: Scenario) -> dict[str, Any]:
        """The entry of [[fault]] of a kind."""
        cls = KINDS[kind]
        table: dict[str, Any] = {"kind": kind, "at_s": at_s}
        if not cls.INSTANT:
            table["for_s"] = self.for_s
        if issubclass(cls, LinkFault):
            table["edges"] = [
                str(edge)
                for edge in edges_of(scenario.topology)
                if edge.source not in SOURCES and not {*edge}.isdisjoint(self.robots)
            ]
        else:
            table["robots"] = list(self.robots)
        return table | dict(self.parameters.get(kind, {}))


@dataclass(frozen=True, slots=True)
class Kinds:
    """The faults of each kind at a first time, and why others can't act."""

    faults: Mapping[str, Fault]
    refused: Mapping[str, str]


def kinds_of(
    scenario: Scenario, kinds: Sequence[str], at_s: float, conditions: Conditions, *, folder: str
) -> Kinds:
    """Faults that the scenario accepts, and why it refuses the others.

    Args:
        scenario: as it was loaded.
        kinds: by name.
        at_s: one of the times.
        conditions: of the campaign.
        folder: where modules of the user's own are looked for first.

    Raises:
        ScenarioError: a parameter that was given is wrong.
    """
    text = to_toml(scenario)
    own = tomllib.loads(text).get("fault", [])
    faults, refused = {}, {}
    for kind in kinds:
        table = conditions.table(kind, at_s, scenario)
        if "edges" in table and not table["edges"]:
            refused[kind] = f"no edge from or to {', '.join(conditions.robots)}"
            continue
        overrides = [Override(f"--faults {kind}", "fault", [*own, table])]
        try:
            faults[kind] = loads(scenario.name, text, overrides, folder=folder).fault[-1]
        except ScenarioError as error:
            given = conditions.parameters.get(kind, ())
            wrong = [one for one in error.complaints if one.key.rpartition(".")[2] in given]
            if wrong or not error.complaints:
                raise
            refused[kind] = "; ".join(one.remedy for one in error.complaints)
    return Kinds(faults, refused)


def cells_of(
    kinds: Sequence[str], times_s: Sequence[float], seeds: Sequence[int]
) -> Iterator[Cell]:
    """All cells, in the order of the matrix."""
    for seed in seeds:
        for kind in kinds:
            for at_s in times_s:
                yield Cell(kind, at_s, seed)


# --- windows --------------------------------------------------------------------------------------


def may_begin_later(expect: Expect) -> bool:
    """Whether the window of an expectation can begin later and say the same of what is left."""
    own_window = expect.to_s is not None or expect.reference is not None
    return not own_window and expect.event is None and expect.holds != "eventually"


@dataclass(frozen=True, slots=True)
class Windows:
    """A cell's expectations with their windows, and its end."""

    strict: tuple[Expect, ...]
    late: tuple[Expect, ...]
    ends_at_s: float


def windows(
    scenario: Scenario, kept_from_s: Sequence[float], fault: Fault, conditions: Conditions
) -> Windows:
    """When a scenario's expectations are asked for under a fault.

    Args:
        scenario: without the fault.
        kept_from_s: T of each expectation [s].
        fault: begins at its `at_s`.
        conditions: of the campaign.
    """
    period_s = scenario.clock.control_period_s
    over_s = fault.at_s + (fault.for_s or 0.0)
    strict, late, ends_s = [], [], [over_s + conditions.hold_s]
    for expect, kept_s in zip(scenario.expect, kept_from_s, strict=True):
        if not may_begin_later(expect):
            strict.append(expect)
            late.append(expect)
            ends_s.append(_ends_s(expect, scenario))
            continue
        late_s = max(over_s, kept_s) + conditions.recover_s
        strict.append(replace(expect, from_s=_at_a_tick(max(fault.at_s, kept_s), period_s)))
        late.append(replace(expect, from_s=_at_a_tick(late_s, period_s)))
        ends_s.append(late_s + (expect.settle_within_s or 0.0) + conditions.hold_s)
    return Windows(tuple(strict), tuple(late), _at_a_tick(max(ends_s), period_s))


def _ends_s(expect: Expect, scenario: Scenario) -> float:
    """When a window that stays as it is has been seen to its end [s]."""
    if expect.event is not None and expect.at_least is None and expect.to_s is None:
        return 0.0  # a count that must not be exceeded: as long as the rest lasts
    window = window_of(expect, scenario, scenario.duration_s)
    return 0.0 if window is None else (window.last + 1) * scenario.clock.control_period_s


def under(scenario: Scenario, fault: Fault, seed: int, found: Windows) -> Scenario:
    """The scenario of a cell, its expectations late."""
    return scenario.model_copy(
        update={
            "seed": seed,
            "until_s": found.ends_at_s,
            "fault": (*scenario.fault, fault),
            "expect": found.late,
        }
    )


def _at_a_tick(t_s: float, period_s: float) -> float:
    """The first tick at or after a time [s]."""
    return round(ceil(t_s / period_s - 1e-6) * period_s, 9)


# --- the command ----------------------------------------------------------------------------------


def command(source: str, given: Sequence[str], made: Scenario, *, in_process: bool) -> str:
    """The command that runs a cell again: it holds if the cell was held or recovered.

    Args:
        source: the scenario's file or name.
        given: what `--set` changes of it in all cells.
        made: the scenario of the cell.
        in_process: whether the cell ran so.
    """
    data = tomllib.loads(to_toml(made))
    words = ["fleetloop", "run", source]
    if in_process:
        words.append("--in-process")
    words += ["--seed", str(made.seed), "--duration", f"{made.ends_at_s:.12g}"]
    for text in given:
        words += ["--set", text]
    words += ["--set", f"fault={inline(data['fault'])}"]
    for n, expect in enumerate(made.expect):
        if may_begin_later(expect):
            words += ["--set", f"expect.{n}.from_s={inline(expect.from_s)}"]
    return shlex.join(words)
