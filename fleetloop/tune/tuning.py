"""A tuning file: a study, the parameters that are searched for, what is asked of them.

    schema = 1
    base = "realtime_100hz"          # all of a study but its name: `fleetloop.sweep.study`
    design = "latin_hypercube"
    cases = 16                       # that every trial is judged over, the same ones
    trials = 60

    [[factor]]                       # what the cases differ in
    key = "robot.r1.pose.y_m"
    uniform = [-1.0, 1.0]

    [[parameter]]                    # `fleetloop.tune.parameters`
    key = "control.k4"
    log_uniform = [0.05, 0.6]
    baseline = 0.18

    [objective]
    quantity = "final_y_e_m"         # as in [keep] of a study
    over = "worst"

    [[constraint]]
    quantity = "settle_s_of_y_e_m"
    at_most = 6.0

A trial is a study whose parameters are factors of one level: it is computed, and its rows are kept,
as those of any study.
"""

import json
import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge, Le, Len
from pydantic import Field

from configs.complaints import refusal
from configs.errors import Complaint, ScenarioError
from configs.files import text_of
from configs.parameters import as_tuples
from configs.wording import guess
from fleetloop.sweep import study as studies
from fleetloop.sweep.draws import Value
from fleetloop.sweep.statistics import parts_of
from fleetloop.sweep.study import MOST_CASES, Keep, Study
from fleetloop.tune.demands import FAILURE_RATE, MARGIN, Constraint, Objective
from fleetloop.tune.parameters import ParameterSection

MOST_TRIALS = 100_000
_MOST_BYTES = 4 << 20
_MARGIN_OF = re.compile(r"expect_\d+_margin")


class Tuning(Study):
    """One tuning."""

    trials: Annotated[int, Ge(1), Le(MOST_TRIALS)] = Field(
        description="their number, the baseline's among them"
    )
    startup_trials: Annotated[int, Ge(1), Le(MOST_TRIALS)] = Field(
        10, description="drawn at random, before the sampler learns from them"
    )
    check_cases: Annotated[int, Ge(1), Le(MOST_CASES)] | None = Field(
        None, description="other cases, on which baseline and best are judged at the end"
    )
    keep: Keep = Keep(quantities=())
    parameter: Annotated[tuple[ParameterSection, ...], Len(1, 50)]
    objective: Objective
    constraint: Annotated[tuple[Constraint, ...], Len(0, 50)] = ()

    @property
    def demands(self) -> tuple[Constraint, ...]:
        """All constraints: of failures there are none, unless the file says otherwise."""
        if any(one.quantity == FAILURE_RATE for one in self.constraint):
            return self.constraint
        return (Constraint(quantity=FAILURE_RATE, at_most=0.0), *self.constraint)

    @property
    def baseline(self) -> dict[str, Value] | None:
        """The values that all others are compared with, by the parameters' names."""
        given = {one.column: one.baseline for one in self.parameter if one.baseline is not None}
        return given if len(given) == len(self.parameter) else None

    def study_of(self, values: Mapping[str, Value], *, check: bool = False) -> Study:
        """The study that judges these values of the parameters.

        Args:
            values: by the parameters' names.
            check: over the other cases.

        Raises:
            ScenarioError: what is wrong with it as a study, in the keys of a tuning file.
        """
        data = self.model_dump(mode="json", by_alias=True, exclude_none=True, exclude=_OWN)
        needed = {self.objective.quantity, *(one.quantity for one in self.demands)}
        named = {one.name for one in self.keep.quantity}
        kept = dict.fromkeys(self.keep.quantities)
        kept |= dict.fromkeys(n for n in sorted(needed - named) if parts_of(n) is not None)
        data["keep"]["quantities"] = list(kept)
        data["factor"] += [
            {"name": one.column, "keys": list(one.every_key), "values": [values[one.column]]}
            for one in self.parameter
        ]
        if check:
            data |= {"cases": self.check_cases, "seed": self.seed + 1}
        return Study.model_validate(as_tuples(data))


_OWN = set(Tuning.model_fields) - set(Study.model_fields)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of tuning files, for editors."""
    schema = Tuning.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def shipped() -> tuple[str, ...]:
    """Names of the tunings in the package."""
    names = (item.name for item in _folder().iterdir() if item.name.endswith(".toml"))
    return tuple(sorted(name.removesuffix(".toml") for name in names))


def load(source: str, *, trials: int | None = None, seed: int | None = None) -> Tuning:
    """Load a tuning by the path of its file or the name of a shipped one.

    Args:
        source: path or name.
        trials: in the place of the file's.
        seed: in the place of the file's.

    Raises:
        ScenarioError: no such file, or all that is wrong with it, a line each.
    """
    if source in shipped():
        text = _folder().joinpath(f"{source}.toml").read_text("utf-8")
        return loads(f"{source}.toml", text, trials=trials, seed=seed)
    path = Path(source)
    if not path.exists():
        raise ScenarioError(
            f"{source}: no such file, and no shipped tuning of that name"
            f"{guess(source, shipped())}; shipped: {', '.join(shipped())}"
        )
    text = text_of(path, "the tuning", _MOST_BYTES)
    return loads(source, text, trials=trials, seed=seed)


def loads(name: str, text: str, *, trials: int | None = None, seed: int | None = None) -> Tuning:
    """Load a tuning from TOML text; `name` stands for the file in messages.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    tuning = studies.loads_as(Tuning, name, text, {"trials": trials, "seed": seed})
    if found := [*_demands(name, tuning), *_baselines(name, tuning), *_check(name, tuning)]:
        raise refusal(found)
    middle = {one.column: one.middle for one in tuning.parameter}
    try:
        studies.loads(name, tuning.study_of(middle).to_toml())
    except ScenarioError as error:
        raise in_our_keys(tuning, error) from None
    return tuning


def in_our_keys(tuning: Tuning, error: ScenarioError) -> ScenarioError:
    """What a study was refused for, in the keys of the tuning that it was made of."""
    if not error.complaints:
        return error
    return refusal([one._replace(key=_our_key(tuning, one.key)) for one in error.complaints])


def _our_key(tuning: Tuning, key: str) -> str:
    table, _, rest = key.partition(".")
    number, _, last = rest.partition(".")
    count = len(tuning.factor)
    if table == "factor" and number.isdigit() and int(number) >= count:
        return f"parameter.{int(number) - count}.{last}"
    if table == "factor" and number in (names := [one.column for one in tuning.parameter]):
        return f"parameter.{names.index(number)}.{last}"
    quantity = key.removeprefix("keep: ")
    if quantity != key and quantity not in tuning.keep.quantities:
        for where, one in places(tuning).items():
            if one.quantity == quantity:
                return f"{where}.quantity"
    return key


def _folder() -> Any:
    return resources.files("configs").joinpath("tunings")


# --- check ----------------------------------------------------------------------------------------


def places(tuning: Tuning) -> dict[str, Objective | Constraint]:
    """What is asked, by its place in the file."""
    found: dict[str, Objective | Constraint] = {"objective": tuning.objective}
    return found | {f"constraint.{n}": one for n, one in enumerate(tuning.constraint)}


def _demands(name: str, tuning: Tuning) -> list[Complaint]:
    found = []
    named = [one.name for one in tuning.keep.quantity]
    for where, one in places(tuning).items():
        text = one.quantity
        known = text in (FAILURE_RATE, MARGIN, *named) or _MARGIN_OF.fullmatch(text)
        if not known and parts_of(text) is None:
            names = ", ".join([FAILURE_RATE, MARGIN, "expect_1_margin", *named])
            remedy = f"no such quantity: a statistic and a signal, as peak_x_e_m, or {names}"
            found.append(Complaint(name, f"{where}.quantity", text, remedy))
    seen: set[str] = set()
    for n, constraint in enumerate(tuning.constraint):
        if constraint.label in seen:
            remedy = "another constraint says the same of it; one is enough"
            found.append(Complaint(name, f"constraint.{n}.quantity", constraint.quantity, remedy))
        seen.add(constraint.label)
    return found


def _baselines(name: str, tuning: Tuning) -> list[Complaint]:
    given = [n for n, one in enumerate(tuning.parameter) if one.baseline is not None]
    if not given:
        return []
    remedy = "must be given, or of no parameter: the baseline is a trial of all of them"
    return [
        Complaint(name, f"parameter.{n}.baseline", "missing", remedy)
        for n in range(len(tuning.parameter))
        if n not in given
    ]


def _check(name: str, tuning: Tuning) -> list[Complaint]:
    found = []
    if tuning.check_cases is not None and tuning.design == "grid":
        remedy = "a grid has no other cases; leave it out, or choose another design"
        found.append(Complaint(name, "check_cases", tuning.check_cases, remedy))
    if (within := tuning.stop.failure_rate_within) is not None:
        remedy = "every trial is judged over all its cases; leave it out"
        found.append(Complaint(name, "stop.failure_rate_within", within, remedy))
    return found


def differences(ours: Tuning, theirs: Tuning) -> list[str]:
    """The keys in which two tunings differ, and how; the number of trials may."""
    one, other = (t.model_dump(mode="json", by_alias=True) for t in (ours, theirs))
    return [
        f"{key}: {json.dumps(other[key], ensure_ascii=False)}, there"
        f" {json.dumps(one[key], ensure_ascii=False)}"
        for key in one
        if key != "trials" and one[key] != other[key]
    ]
