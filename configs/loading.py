"""Read, check and write scenario files.

A scenario is named by the path of a TOML file or by the name of a shipped one. All problems of a
file come at once, a line each: file, key, value, remedy.
"""

import copy
import difflib
import tomllib
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from configs.changes import overrides_of
from configs.checks import cross_problems
from configs.complaints import complaints, refusal, salvage
from configs.errors import Complaint, Problem, ScenarioError
from configs.graph_inclusion import included_graph
from configs.origin import Origin
from configs.overrides import Override
from configs.parameters import as_tuples
from configs.scenario import Scenario

_NOT_SCENARIOS = {"starter"}


def shipped() -> tuple[str, ...]:
    """Names of the scenarios in the package."""
    folder = resources.files("configs")
    names = (item.name for item in folder.iterdir() if item.name.endswith(".toml"))
    return tuple(sorted({name.removesuffix(".toml") for name in names} - _NOT_SCENARIOS))


def load(source: str | Path, overrides: Sequence[str | Override] = ()) -> Scenario:
    """Load a scenario by path or shipped name, with overrides (texts as `--set` takes them).

    Raises:
        ScenarioError: no such scenario, or all that is wrong with it, a line each.
    """
    if not isinstance(source, str | Path):
        raise TypeError(f"load({source!r}): the path of a scenario file, or a shipped name")
    name, text = read(str(source))
    return loads(name, text, overrides, folder=folder_of(source))


def folder_of(source: str | Path) -> str:
    """Where modules of one's own are looked for first; of a shipped scenario the current folder."""
    return "" if str(source) in shipped() else str(Path(source).parent)


def loads(
    name: str,
    text: str,
    overrides: Sequence[str | Override] = (),
    *,
    folder: str = "",
    recorded: bool = False,
) -> Scenario:
    """Load a scenario from TOML text; `name` stands for the file in messages.

    Args:
        name: of the file.
        text: of the file.
        overrides: as `load` takes them.
        folder: where modules of one's own are looked for first; the current one if not given.
        recorded: it is a record's: laws and shapes that aren't here are taken as they come.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{name}: not a TOML file: {error}") from error
    return of_data(name, data, overrides, folder, recorded=recorded)


def changed(scenario: Scenario, changes: Iterable[tuple[str, object]]) -> Scenario:
    """A scenario with these changes of its file (`configs.changes`); checked as a file is.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    origin = scenario.origin
    if origin is None:  # not from a file: then with all defaults
        origin = Origin(scenario.name, "", tomllib.loads(to_toml(scenario)))
    data = copy.deepcopy(dict(origin.data))
    return of_data(origin.source, data, overrides_of(changes, data), origin.folder)


def of_data(
    name: str,
    data: dict[str, Any],
    overrides: Sequence[str | Override],
    folder: str,
    *,
    recorded: bool = False,
) -> Scenario:
    """Load a scenario from parsed TOML, which becomes its own; tables in it may be others' as well.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    found: list[Complaint] = []
    applied: list[Override] = []
    for override in overrides:
        one = Override.from_set(override) if isinstance(override, str) else override
        done = one if isinstance(one, Complaint) else one.apply(data)
        if isinstance(done, Complaint):
            found.append(done)
        else:
            applied.append(done)
    if (wrong := included_graph(data, Path(folder))) is not None:
        found.append(blamed(name, wrong, applied))
    scenario = _check(name, data, applied, found, context_of(folder, recorded=recorded))
    return scenario.originating(Origin(name, folder, data))


def context_of(folder: str, *, recorded: bool = False) -> dict[str, Any]:
    """The context in which a scenario is validated (`configs.choices`)."""
    return {"folder": str(Path(folder).resolve()), "recorded": recorded}


def to_toml(scenario: Scenario) -> str:
    """The scenario with all defaults written out; loads back to an equal one."""
    return tomli_w.dumps(scenario.model_dump(mode="json", by_alias=True, exclude_none=True))


def json_schema() -> dict[str, Any]:
    """The JSON Schema of scenario files, for editors."""
    schema = Scenario.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def read(source: str) -> tuple[str, str]:
    """The name of a scenario's file in messages, and its text; by path or shipped name.

    Raises:
        ScenarioError: there is none.
    """
    if source in shipped():
        return f"{source}.toml", resources.files("configs").joinpath(f"{source}.toml").read_text(
            "utf-8"
        )
    path = Path(source)
    if path.is_dir():
        files = ", ".join(str(file) for file in sorted(path.glob("*.toml"))[:3])
        has = f"; there is {files}" if files else ""
        raise ScenarioError(f"{path}: a folder, not the file of a scenario{has}")
    try:
        return str(path), path.read_text("utf-8")
    except FileNotFoundError as error:
        close = difflib.get_close_matches(source, shipped(), 1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise ScenarioError(
            f"{source}: no such file, and no shipped scenario of that name{hint};"
            f" shipped: {', '.join(shipped())}"
        ) from error
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{source}: not a TOML file: no text in UTF-8") from error
    except OSError as error:
        raise ScenarioError(f"{source}: can't be read: {error.strerror or error}") from error


# --- check ----------------------------------------------------------------------------------------


def _check(
    name: str,
    data: dict[str, Any],
    overrides: Sequence[Override],
    found: list[Complaint],
    context: dict[str, Any],
) -> Scenario:
    scenario: Scenario | None = None
    try:
        scenario = Scenario.model_validate(as_tuples(data), context=context)
        problems = cross_problems(scenario)
    except ValidationError as error:
        problems = complaints(error, data)
        if (rest := salvage(error, data, context)) is not None:
            problems += filter(rest.believes, cross_problems(rest.scenario))
    found += [blamed(name, problem, overrides) for problem in problems]
    if found or scenario is None:
        raise refusal(found)
    return scenario


def blamed(name: str, problem: Problem, overrides: Sequence[str | Override]) -> Complaint:
    """A problem with its origin: the last option that set the key, or the file."""
    for text in reversed(overrides):
        override = Override.from_set(text) if isinstance(text, str) else text
        if isinstance(override, Override) and override.is_about(problem.key):
            key = "" if problem.key == override.key else problem.key
            return Complaint(override.option, key, problem.value, problem.remedy)
    return Complaint(name, *problem)
