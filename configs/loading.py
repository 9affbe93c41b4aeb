"""Read, check and write scenario files.

A scenario is named by the path of a TOML file or by the name of a shipped one. All problems of a
file come at once, a line each: file, key, value, and what would be right.
"""

import difflib
import tomllib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from configs.complaints import complaints, line, salvage
from configs.cross_checks import Problem, cross_problems
from configs.errors import ScenarioError
from configs.scenario import Scenario

_NOT_SCENARIOS = {"starter"}


def shipped() -> tuple[str, ...]:
    """Names of the scenarios in the package."""
    folder = resources.files("configs")
    names = (item.name for item in folder.iterdir() if item.name.endswith(".toml"))
    return tuple(sorted({name.removesuffix(".toml") for name in names} - _NOT_SCENARIOS))


def load(source: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Load a scenario by path or shipped name, with `key=value` overrides.

    Raises:
        ScenarioError: no such scenario, or all that is wrong with it, a line each.
    """
    return loads(*_read(str(source)), overrides)


def loads(name: str, text: str, overrides: Sequence[str] = ()) -> Scenario:
    """Load a scenario from TOML text; `name` stands for the file in messages.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{name}: not a TOML file: {error}") from error
    for override in overrides:
        _override(data, override)
    return _check(name, data)


def to_toml(scenario: Scenario) -> str:
    """The scenario with all defaults written out; loads back to an equal one."""
    return tomli_w.dumps(scenario.model_dump(mode="json", by_alias=True, exclude_none=True))


def json_schema() -> dict[str, Any]:
    """The JSON Schema of scenario files, for editors."""
    schema = Scenario.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _read(source: str) -> tuple[str, str]:
    if source in shipped():
        return f"{source}.toml", resources.files("configs").joinpath(f"{source}.toml").read_text(
            "utf-8"
        )
    path = Path(source)
    try:
        return str(path), path.read_text("utf-8")
    except (FileNotFoundError, IsADirectoryError) as error:
        close = difflib.get_close_matches(source, shipped(), 1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise ScenarioError(
            f"{source}: no such file, and no shipped scenario of that name{hint};"
            f" shipped: {', '.join(shipped())}"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{source}: can't be read: {error}") from error


# --- check ----------------------------------------------------------------------------------------


def _check(name: str, data: dict[str, Any]) -> Scenario:
    problems: list[Problem] = []
    scenario: Scenario | None = None
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        problems += complaints(error, data)
        scenario = salvage(error, data)
    if scenario is not None:
        problems += cross_problems(scenario)
    if problems or scenario is None:
        raise ScenarioError("\n".join(dict.fromkeys(line(name, problem) for problem in problems)))
    return scenario


# --- overrides ------------------------------------------------------------------------------------


def _override(data: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise ScenarioError(f"--set {override}: must read key=value, for example coordination.p=3")
    try:
        value = tomllib.loads(f"value = {text.strip()}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    holder: Any = data
    for part in parts[:-1]:
        holder = _step_into(holder, part, override)
    if isinstance(holder, dict):
        holder[parts[-1]] = value
    elif isinstance(holder, list) and parts[-1].isdigit() and int(parts[-1]) < len(holder):
        holder[int(parts[-1])] = value
    else:
        raise ScenarioError(f"--set {override}: {parts[-1]} names nothing there")


def _step_into(holder: Any, part: str, override: str) -> Any:
    if isinstance(holder, dict):
        return holder.setdefault(part, {})
    if isinstance(holder, list):
        for item in holder:
            if isinstance(item, dict) and item.get("name") == part:
                return item
        if part.isdigit() and int(part) < len(holder):
            return holder[int(part)]
        names = [
            str(item.get("name", n)) for n, item in enumerate(holder) if isinstance(item, dict)
        ]
        raise ScenarioError(f"--set {override}: no {part!r} there; known: {', '.join(names)}")
    raise ScenarioError(f"--set {override}: {part} is no table")
