"""The cases of a study: their values, their scenarios, and the command that runs one again.

Loading a scenario would be a case's largest cost, so the base is loaded once and cases are its
variants (`configs.variants`).
"""

import re
import shlex
import tomllib
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from configs.complaints import refusal
from configs.errors import Complaint, ScenarioError
from configs.faults.plan import process_fault_problem
from configs.loading import loads
from configs.overrides import Override, inline
from configs.scenario import Scenario
from configs.variants import Variants
from fleetloop.sweep.design import Design
from fleetloop.sweep.draws import Draw, Value
from fleetloop.sweep.factors import GRAPH
from fleetloop.sweep.plan import Plan
from fleetloop.sweep.quantities import Quantities, quantities_of
from fleetloop.sweep.study import Study

EVERY = "*"
_OF_KEYS = re.compile(r"unknown key|no |.* names nothing there|.* is in no table")
"""Beginnings of the remedies of keys that aren't there."""


class Factor(NamedTuple):
    """A factor of a study."""

    name: str
    keys: tuple[str, ...]  # of the scenario, all robots named
    draw: Draw


class Case(NamedTuple):
    """One case of a study."""

    number: int
    values: tuple[Value, ...]
    """Of its factors, in their order."""


class Cases:
    """All cases of a plan.

    Args:
        plan: the study and its base.
        name: of the study's file in messages.

    Raises:
        ScenarioError: the base is wrong, or the study doesn't fit it.
    """

    def __init__(self, plan: Plan, name: str = "study.toml") -> None:
        self.plan = plan
        self.study: Study = plan.study
        base = plan.base
        overrides = _overrides(name, self.study.set_)
        self.base: Scenario = loads(base.name, base.text, overrides, folder=base.folder)
        _refuse(base.source, self.base)
        table: dict[str, Any] = tomllib.loads(base.text)
        self._variants = Variants(self.base, table, overrides, base.folder)
        for one in overrides:
            one.apply(table)
        graph = table.get(GRAPH)
        self._graph: dict[str, Any] = graph if isinstance(graph, dict) else {}
        self.factors = tuple(
            Factor(one.column, expanded(one.every_key, self.base.names), one.draw(self.base.names))
            for one in self.study.factor
        )
        _refuse_repeated(name, self.factors)
        self.quantities: Quantities
        self.quantities, found = quantities_of(self.study, self.base, name)
        if found:
            raise refusal(found)
        self._design = Design(self.study, [factor.draw for factor in self.factors])
        self._refuse_unknown_keys(name)

    def case(self, number: int) -> Case:
        """The case of a number."""
        return Case(number, self._design.values(number))

    def scenario(self, case: Case) -> Scenario:
        """The scenario of a case.

        Raises:
            ScenarioError: its values make no valid one; the text names the case and the value.
        """
        overrides: list[Override] = []
        for factor, value in zip(self.factors, case.values, strict=True):
            option = f"case {case.number}: {factor.name} = {factor.draw.shown(value)}"
            set_to = factor.draw.overrides(value, self._graph)
            overrides += [Override(option, key, set_to) for key in factor.keys]
        scenario = self._variants.scenario(f"case {case.number}", overrides)
        _refuse(f"case {case.number}", scenario)
        return scenario

    def shown(self, case: Case) -> dict[str, Value]:
        """The values of a case by the factors' names, as a dataset has them."""
        pairs = zip(self.factors, case.values, strict=True)
        return {factor.name: factor.draw.shown(value) for factor, value in pairs}

    def command(self, case: Case) -> str:
        """The command that runs a case again; also one that `fleetloop check` calls an error."""
        words = ["fleetloop", "run", self.plan.base.source, "--in-process", "--force"]
        for text in self.study.set_:
            words += ["--set", text]
        for factor, value in zip(self.factors, case.values, strict=True):
            set_to = inline(factor.draw.overrides(value, self._graph))
            for key in factor.keys:
                words += ["--set", f"{key}={set_to}"]
        return shlex.join(words)

    def _refuse_unknown_keys(self, name: str) -> None:
        """Refuse a factor whose key no value of it makes a known one."""
        found: list[Complaint] = []
        for n, (factor, section) in enumerate(zip(self.factors, self.study.factor, strict=True)):
            where = f"factor.{section.name or n}.key"
            complaints: list[Complaint] = []
            for u in (0.5, 0.0, 1.0 - 2.0**-53):
                value = factor.draw.at(u)
                set_to = factor.draw.overrides(value, self._graph)
                overrides = [Override(factor.name, key, set_to) for key in factor.keys]
                try:
                    self._variants.scenario(name, overrides)
                except ScenarioError as error:
                    complaints = complaints or [
                        Complaint(name, where, ", ".join(factor.keys), one.remedy)
                        for one in error.complaints
                        if _OF_KEYS.match(one.remedy)
                    ]
                else:
                    complaints = []
                    break
            found += complaints
        if found:
            raise refusal(found)


@lru_cache(maxsize=2)
def cases_of(plan: Plan) -> Cases:
    """The cases of a plan, once in a process."""
    return Cases(plan)


def _overrides(name: str, texts: Sequence[str]) -> list[Override]:
    """Those of a study's `set`, which errors name instead of an option."""
    made: list[Override] = []
    found: list[Complaint] = []
    for n, text in enumerate(texts):
        option = f"{name}: set.{n} = {text}"
        match Override.from_set(text):
            case Override() as one:
                made.append(one._replace(option=option))
            case wrong:
                found.append(wrong._replace(where=option))
    if found:
        raise refusal(found)
    return made


def _refuse_repeated(name: str, factors: Sequence[Factor]) -> None:
    """Refuse a key that is set twice: the last would win, and the other look like a result.

    Raises:
        ScenarioError: it names both factors.
    """
    found: list[Complaint] = []
    of: dict[str, Factor] = {}
    for n, factor in enumerate(factors):
        for key in factor.keys:
            if key in of:
                remedy = f"factor {of[key].name} sets it already"
                found.append(Complaint(name, f"factor.{n}", key, remedy))
            of.setdefault(key, factor)
    if found:
        raise refusal(found)


def _refuse(source: str, scenario: Scenario) -> None:
    """Refuse what can't be run in one process.

    Raises:
        ScenarioError: clock or faults of processes.
    """
    if scenario.clock.mode == "realtime":
        raise ScenarioError(
            f'{source}: clock.mode = "realtime" would judge the machine, too; add'
            ' set = ["clock.mode=lockstep"]'
        )
    if problem := process_fault_problem(scenario):
        raise ScenarioError(f"{source}: {problem}; a sweep has none: leave them out")


def expanded(keys: Sequence[str], robots: Sequence[str]) -> tuple[str, ...]:
    """The keys with each robot's name in the place of the star of `robot.*`."""
    found = []
    for key in keys:
        parts = key.split(".")
        if parts[:1] == ["robot"] and parts[1:2] == [EVERY]:
            found += [".".join(["robot", robot, *parts[2:]]) for robot in robots]
        else:
            found.append(key)
    return tuple(found)
