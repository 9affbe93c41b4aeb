"""A study file: a base scenario, what is varied, how it is sampled, what is kept, when it ends.

    schema = 1
    title = "Mass and damping"
    base = "two_robots"              # a shipped scenario, or a file beside the study
    design = "latin_hypercube"       # grid, random, latin_hypercube, sobol
    cases = 1000                     # of a grid all its points
    set = ["until_s=5"]              # as --set, in every case

    [[factor]]                       # `fleetloop.sweep.factors`
    key = "robot_types.etsro.body_mass_kg"
    uniform = [1.5, 4.0]

    [keep]
    quantities = ["peak_x_e_m"]      # `fleetloop.sweep.quantities`
    worst = 3                        # whole runs of the worst cases

    [stop]
    failure_rate_within = 0.02       # half width of its confidence interval

The schema is closed; what is wrong comes at once, a line each: file, key, value, remedy.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import tomli_w
from annotated_types import Ge, Gt, Le, Len, Lt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from configs.complaints import complaints, refusal
from configs.errors import Complaint, Problem, ScenarioError
from configs.files import text_of
from configs.parameters import MOST_S, Parameters, Seconds, Seed, as_tuples, parameter
from configs.wording import MISSING, guess
from fleetloop.sweep.factors import KINDS, FactorSection
from fleetloop.sweep.statistics import QuantitySection

MOST_CASES = 10_000_000
_MOST_BYTES = 4 << 20
DEFAULT_QUANTITIES = (
    "settle_s_of_x_e_m",
    "settle_s_of_y_e_m",
    "settle_s_of_theta_e_rad",
    "final_x_e_m",
    "final_y_e_m",
    "final_theta_e_rad",
    "peak_s_spread",
    "final_s_spread",
    "peak_torque_wheel_N_m",
)
RESERVED = (
    *("case", "verdict", "reason", "margin", "engine", "engine_reason"),
    *("seed", "wall_s", "command", "version"),
)
"""Columns that every dataset has; a factor whose key is `seed` is that column."""
MEASURED, SAMPLED, CONTINUOUS = "growth_1_s", "growth_sampled_1_s", "growth_46_1_s"
"""Columns of a study that is held against theory (`fleetloop.sweep.theory`)."""
Condition = Literal["sampled", "(46)"]

Cases = Annotated[int, Ge(1), Le(MOST_CASES)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Keep(Parameters):
    """What is kept of each case, besides its verdict and the margins of its expectations."""

    quantities: Annotated[tuple[str, ...], Len(0, 200)] = parameter(
        DEFAULT_QUANTITIES, "a column each: a statistic and a signal, as peak_x_e_m"
    )
    quantity: Annotated[tuple[QuantitySection, ...], Len(0, 200)] = parameter(
        (), "those with a name, or robots, of their own, one [[keep.quantity]] each"
    )
    worst: Annotated[int, Ge(0), Le(100)] = parameter(
        0, "cases whose runs are kept whole: those that failed, and of the others the least margins"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Stopping(Parameters):
    """When a study ends before all its cases are done."""

    failure_rate_within: Annotated[float, Gt(0), Lt(1)] | None = parameter(
        None, "as soon as the confidence interval of the failure rate is no wider to either side"
    )
    confidence: Annotated[float, Gt(0), Lt(1)] = parameter(0.95, "of that interval")
    least_cases: Cases = parameter(30, "that interval isn't looked at before")
    budget_s: Seconds | None = parameter(None, "longest wall time of one command")


@dataclass(frozen=True, slots=True, kw_only=True)
class Theory(Parameters):
    """What each case is held against: whether its path variables' disagreement grows."""

    stability: Condition = parameter(
        "sampled",
        "a case whose simulation has another sign fails: of the law as it is sampled, or (46), of"
        " the law in continuous time",
    )


class Study(BaseModel):
    """One study."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    title: Annotated[str, Len(1, 200)] = "study"
    description: str = ""
    base: Annotated[str, Len(1, 4096)] = Field(
        description="the name of a shipped scenario, or a file, relative to the study"
    )
    set_: tuple[str, ...] = Field(
        (), alias="set", description="overrides of the base in every case, as --set takes them"
    )
    design: Literal["grid", "random", "latin_hypercube", "sobol"] = Field(
        description="how cases are chosen: all combinations of levels, or samples"
    )
    cases: Cases | None = Field(None, description="their number; of a grid not more than these")
    seed: Seed = Field(1, description="of the samples; that of the scenario is a key as any other")
    invalid: Literal["go on", "stop"] = Field(
        "go on", description="what to do if the values of a case make no valid scenario"
    )
    limit_s: Annotated[float, Gt(0), Le(MOST_S)] = Field(
        300.0, description="longest wall time of a case; then it is an error and the others go on"
    )
    factor: Annotated[tuple[FactorSection, ...], Len(1, 200)]
    keep: Keep = Keep()
    theory: Theory | None = Field(None, description="if given, what each case is held against")
    stop: Stopping = Stopping()

    def to_toml(self) -> str:
        """The text of a study file that says all of this, defaults too."""
        return tomli_w.dumps(self.model_dump(mode="json", by_alias=True, exclude_none=True))

    @property
    def total(self) -> int:
        """The number of its cases."""
        if self.design != "grid":
            return self.cases or 0
        product = 1
        for factor in self.factor:
            product *= factor.count or 1
        return min(product, self.cases or product)


_S = TypeVar("_S", bound=Study)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of study files, for editors."""
    schema = Study.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def shipped() -> tuple[str, ...]:
    """Names of the studies in the package."""
    names = (item.name for item in _folder().iterdir() if item.name.endswith(".toml"))
    return tuple(sorted(name.removesuffix(".toml") for name in names))


def load(source: str, *, cases: int | None = None, seed: int | None = None) -> Study:
    """Load a study by the path of its file or the name of a shipped one.

    Args:
        source: path or name.
        cases: in the place of the file's.
        seed: in the place of the file's.

    Raises:
        ScenarioError: no such study, or all that is wrong with it, a line each.
    """
    changes = {"cases": cases, "seed": seed}
    if source in shipped():
        text = _folder().joinpath(f"{source}.toml").read_text("utf-8")
        return loads(f"{source}.toml", text, changes)
    path = Path(source)
    if not path.exists():
        hint = guess(source, shipped())
        raise ScenarioError(
            f"{source}: no such file, and no shipped study of that name{hint};"
            f" shipped: {', '.join(shipped())}"
        )
    return loads(source, text_of(path, "the study", _MOST_BYTES), changes)


def loads(name: str, text: str, changes: dict[str, int | None] | None = None) -> Study:
    """Load a study from TOML text; `name` stands for the file in messages.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    return loads_as(Study, name, text, changes)


def loads_as(
    kind: type[_S], name: str, text: str, changes: dict[str, int | None] | None = None
) -> _S:
    """Load a file that is a study, and more.

    Args:
        kind: of what it is.
        name: stands for the file in messages.
        text: of the file.
        changes: keys, and what is in their place if it is given: options of the same names.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{name}: not a TOML file: {error}") from error
    data.setdefault("title", Path(name).stem)
    given = {key: value for key, value in (changes or {}).items() if value is not None}
    found: list[Complaint] = []
    try:
        study = kind.model_validate(as_tuples(data | given))
        found = [_blamed(name, problem, given) for problem in _problems(study)]
    except ValidationError as error:
        found = [_blamed(name, it, given) for it in complaints(error, data | given, kind)]
    if found:
        raise refusal(found)
    return study


def _blamed(name: str, problem: Problem, given: dict[str, int]) -> Complaint:
    if problem.key in given:
        return Complaint(f"--{problem.key} {problem.value}", "", problem.value, problem.remedy)
    return Complaint(name, *problem)


def _folder() -> Any:
    return resources.files("configs").joinpath("studies")


# --- check ----------------------------------------------------------------------------------------


def _problems(study: Study) -> Iterator[Problem]:
    yield from _names(study)
    yield from _designs(study)
    if study.design == "grid" and study.stop.failure_rate_within is not None:
        remedy = "of samples; the points of a grid are none: choose another design"
        yield Problem("stop.failure_rate_within", study.stop.failure_rate_within, remedy)


def _names(study: Study) -> Iterator[Problem]:
    seen: dict[str, int] = {}
    reserved = RESERVED if study.theory is None else (*RESERVED, MEASURED, SAMPLED, CONTINUOUS)
    for n, factor in enumerate(study.factor):
        where, name = f"factor.{n}.name", factor.column
        if name in reserved and factor.every_key != (name,):
            yield Problem(where, name, f"is a column of every dataset ({', '.join(reserved)})")
        elif name in seen:
            yield Problem(where, name, f"factor {seen[name]} has it already; give another name")
        seen.setdefault(name, n)
    for n, one in enumerate(study.keep.quantity):
        if one.name in seen or one.name in reserved:
            yield Problem(f"keep.quantity.{n}.name", one.name, "another column has this name")
        seen.setdefault(one.name, n)
    for n, text in enumerate(study.keep.quantities):
        if text in seen:
            yield Problem(f"keep.quantities.{n}", text, "another column has this name")
        seen.setdefault(text, n)


def _designs(study: Study) -> Iterator[Problem]:
    if study.design != "grid":
        if study.cases is None:
            yield Problem("cases", MISSING, f"must be given with design = {study.design}")
        return
    for n, factor in enumerate(study.factor):
        if factor.count is None:
            (kind,) = (kind for kind in KINDS if getattr(factor, kind) is not None)
            remedy = "has no levels for a grid: give values, range or integers, or another design"
            yield Problem(f"factor.{factor.name or n}.{kind}", factor.column, remedy)
    if study.total > MOST_CASES:
        yield Problem("factor", study.total, f"cases of the grid: must be at most {MOST_CASES}")
