"""A tuning with its base scenario: all that decides its trials.

tuning.toml            the tuning, all defaults written out
base.toml, base.json   its base scenario, and where that came from
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from configs.complaints import refusal
from configs.errors import Complaint, ScenarioError
from configs.loading import loads as scenario_of
from configs.overrides import Override
from fleetloop.results import run_folder
from fleetloop.sweep.cases import Cases, expanded
from fleetloop.sweep.draws import Value
from fleetloop.sweep.plan import Base, Plan, saved
from fleetloop.tune import tuning as tunings
from fleetloop.tune.demands import FAILURE_RATE, MARGIN
from fleetloop.tune.tuning import Tuning

TUNING = "tuning.toml"


@dataclass(frozen=True, slots=True)
class TuningPlan:
    """A tuning and its base."""

    tuning: Tuning
    base: Base

    @classmethod
    def of(cls, source: str, *, trials: int | None = None, seed: int | None = None) -> "TuningPlan":
        """Of a tuning's file or name.

        Raises:
            ScenarioError: it, or its base, isn't there or is wrong.
        """
        tuning = tunings.load(source, trials=trials, seed=seed)
        return cls(tuning, Base.beside(source, tuning.base))

    @classmethod
    def resume(cls, folder: Path, *, trials: int | None = None) -> "TuningPlan":
        """Of a folder in which a tuning was begun.

        Raises:
            ScenarioError: none was.
            InfrastructureError: its files can't be read.
        """
        path = folder / TUNING
        return cls(tunings.loads(str(path), saved(path), trials=trials), Base.resume(folder))

    def save(self, folder: Path) -> None:
        """Write its files.

        Raises:
            InfrastructureError: one can't be written.
        """
        self.base.save(folder)
        run_folder.write(folder / TUNING, self.tuning.to_toml())

    def cases(self, values: Mapping[str, Value], *, check: bool = False) -> Cases:
        """The cases that judge these values of the parameters.

        Raises:
            ScenarioError: the tuning doesn't fit its base.
        """
        study = self.tuning.study_of(values, check=check)
        return Cases(Plan(study.to_toml(), self.base), TUNING)

    def check(self, name: str) -> Cases:
        """The cases of the middle of all ranges; refuse what can't be computed.

        Args:
            name: of the file in messages.

        Raises:
            ScenarioError: what doesn't fit the base, a line each.
        """
        tuning = self.tuning
        middle = {one.column: one.middle for one in tuning.parameter}
        study = tuning.study_of(middle)
        try:
            cases = Cases(Plan(study.to_toml(), self.base), name)
        except ScenarioError as error:
            raise tunings.in_our_keys(tuning, error) from None
        known = (FAILURE_RATE, MARGIN, *cases.quantities.names)
        found = []
        for where, one in tunings.places(tuning).items():
            if one.quantity not in known:
                remedy = f"the base has no such expectation; known: {', '.join(known)}"
                found.append(Complaint(name, f"{where}.quantity", one.quantity, remedy))
            if one.quantity == MARGIN and not cases.quantities.expected:
                remedy = "the base has no expectations: there is no margin"
                found.append(Complaint(name, f"{where}.quantity", one.quantity, remedy))
        found += self._of_ends(name, cases, middle)
        if found:
            raise refusal(found)
        return cases

    def _of_ends(self, name: str, cases: Cases, middle: Mapping[str, Value]) -> list[Complaint]:
        """What the ends of the ranges are refused for, each beside the middle of the others."""
        found: list[Complaint] = []
        for n, parameter in enumerate(self.tuning.parameter):
            for end in parameter.ends:
                overrides: list[str | Override] = [*self.tuning.set_]
                for one in self.tuning.parameter:
                    value = end if one is parameter else middle[one.column]
                    overrides += [
                        Override(one.column, key, value)
                        for key in expanded(one.every_key, cases.base.names)
                    ]
                base = self.base
                try:
                    scenario_of(base.name, base.text, overrides, folder=base.folder)
                except ScenarioError as error:
                    why = "; ".join(one.remedy for one in error.complaints) or str(error)
                    remedy = f"makes no valid scenario: {why}"
                    found.append(Complaint(name, f"parameter.{n}: {parameter.column}", end, remedy))
        return found
