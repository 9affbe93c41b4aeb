"""Errors of a file in terms of the file: key, value, remedy."""

import copy
import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from configs.errors import Complaint, KeyValueError, Problem, ScenarioError
from configs.parameters import as_tuples
from configs.scenario import Scenario
from configs.wording import MISSING, guess, remedy_of, unknown_key

_NOTHING = object()
_KEY = "[key]"  # pydantic's mark of an error in a key rather than in its value

_UNKNOWN_KEY = {"extra_forbidden", "unexpected_keyword_argument"}
_ROUNDS = 8
_STAND_INS: dict[object, object] = {
    "schema": 1,
    "name": "unnamed",
    "pose": {"x_m": 0.0, "y_m": 0.0},
    "x_m": 0.0,
    "y_m": 0.0,
    "signal": "s",
}
"""For required keys that are missing or wrong, so that the rest can be checked as well."""


def shown(complaint: Complaint) -> str:
    """One line for people."""
    where, key, value, remedy = complaint
    return f"{where}: {key} = {_shown(value)}: {remedy}" if key else f"{where}: {remedy}"


def refusal(complaints: Sequence[Complaint]) -> ScenarioError:
    """All that is wrong as one error, a line each."""
    lines = dict.fromkeys(shown(complaint) for complaint in complaints)
    return ScenarioError("\n".join(lines), complaints)


def complaints(
    error: ValidationError, data: dict[str, Any], model: type[BaseModel] = Scenario
) -> list[Problem]:
    """All that pydantic has against the parsed file `data`, which should be a `model`."""
    return [_problem(dict(item), data, model) for item in _errors(error)]


def in_words(error: ValidationError) -> str:
    """One error of pydantic in the words of this project."""
    return remedy_of(error.errors(include_url=False)[0])


class Salvage(NamedTuple):
    """What can be made of a scenario with errors, so that the rest can be checked as well."""

    scenario: Scenario
    lost: tuple[str, ...]  # keys that were dropped: what a check says of them isn't to be believed

    def believes(self, problem: Problem) -> bool:
        """Whether a problem is of the file itself, not of a stand-in for a lost key."""
        if "control.law" in self.lost and self._is_of_the_fleets_law(problem.key):
            return False
        text = f"{problem.key} {problem.remedy}"
        if "drive.protocol" in self.lost and "drive." in text:
            return False
        return not any(key in text or key.startswith(f"{problem.key}.") for key in self.lost)

    def _is_of_the_fleets_law(self, key: str) -> bool:
        """Whether the law of [control] gives a key its meaning: a signal, a robot's gain."""
        if key.endswith(".signal"):
            return True
        return any(
            key.startswith(f"robot.{robot.name}.control.") and "law" not in robot.control.table
            for robot in self.scenario.robot
        )


def salvage(
    error: ValidationError, data: dict[str, Any], context: dict[str, Any]
) -> Salvage | None:
    """The scenario without its errors, read in this context; None if too many."""
    rest = copy.deepcopy(data)
    lost: set[str] = set()
    found: ValidationError | None = error
    for _ in range(_ROUNDS):
        if found is None:
            break
        for item in _errors(found):
            lost |= _repair(rest, item)
        try:
            scenario = Scenario.model_validate(as_tuples(rest), context=context)
            return Salvage(scenario, tuple(lost - {"name"}))  # nothing depends on its name
        except ValidationError as more:
            found = more
    return None


def _errors(error: ValidationError) -> list[dict[str, Any]]:
    """Without lists that are too short only because of errors in their entries."""
    return [
        dict(item)
        for item in error.errors(include_url=False)
        if item["type"] != "too_short" or len(item["input"]) < item["ctx"]["min_length"]
    ]


def _repair(data: dict[str, Any], item: Mapping[str, Any]) -> set[str]:
    """Drop or replace the place of one error; return the keys whose meaning is lost."""
    loc = item["loc"]
    holders: list[Any] = [data]
    keys: list[int | str] = []
    for part in loc[:-1]:
        inner = _get(holders[-1], part)
        if inner is not _NOTHING:  # else the tag of a union, which is no key of the file
            holders.append(inner)
            keys.append(part)
    last, holder = loc[-1], holders[-1]
    if item["type"] == "missing" and last in _STAND_INS and isinstance(holder, dict):
        number = keys[-1] if keys and isinstance(keys[-1], int) else ""
        stand_in = _STAND_INS[last]
        holder[last] = f"{stand_in}{number}" if last == "name" else copy.deepcopy(stand_in)
        return {str(_STAND_INS["name"])} if last == "name" else set()
    if last != _KEY and isinstance(holder, dict) and last in holder:
        del holder[last]
        return {".".join(str(part) for part in [*keys, last])}
    if keys and isinstance(holders[-2], dict):
        del holders[-2][keys[-1]]
        return {".".join(map(str, keys))}
    if len(keys) > 1 and isinstance(keys[-1], int) and isinstance(holders[-3], dict):
        del holders[-3][keys[-2]]
        return {".".join(map(str, keys[:-1]))}
    return set()


def _get(holder: object, part: int | str) -> Any:
    if isinstance(holder, dict) and part in holder:
        return holder[part]
    if isinstance(holder, list) and isinstance(part, int) and part < len(holder):
        return holder[part]
    return _NOTHING


def _problem(item: dict[str, Any], data: dict[str, Any], model: type[BaseModel]) -> Problem:
    loc: list[int | str] = list(item["loc"])
    names: list[str] = []
    holder: Any = data
    for n, part in enumerate(loc):
        inner = _get(holder, part)
        last = n == len(loc) - 1
        whole = item["type"] == "value_error" and item["input"] == as_tuples(holder)
        named = last and isinstance(holder, dict | list) and not whole
        if inner is _NOTHING and not named:
            continue  # the tag of a union
        if isinstance(part, int) and isinstance(inner, dict) and "name" in inner:
            names.append(str(inner["name"]))
        elif part not in ("schema_", _KEY):
            names.append(str(part))
        holder = inner
    if item["type"] in _UNKNOWN_KEY:
        return Problem(".".join(names), item["input"], _unknown(loc, model))
    if item["type"].startswith("union_tag"):
        tag = holder.get("kind", MISSING)
        tags = item["ctx"].get("expected_tags", "")
        known = [tag.strip(" '") for tag in tags.split(",")]
        remedy = f"must be one of {tags}{guess(str(tag), known)}" if tags else "must be given"
        return Problem(".".join([*names, "kind"]), tag, remedy)
    value = MISSING if item["type"] == "missing" else item["input"]
    error = item.get("ctx", {}).get("error")
    if isinstance(error, KeyValueError):
        return Problem(".".join([*names, error.key]), _value_of(error.key, value), error.remedy)
    return Problem(".".join(names), value, remedy_of(item))


def _value_of(key: str, table: Any) -> object:
    """The value of a key of a table, of an entry of a list as of `"delays_s.3"`."""
    for part in key.split("."):
        table = table[int(part)] if isinstance(table, list | tuple) else table.get(part, MISSING)
    return table


def _unknown(loc: Sequence[int | str], model: type[BaseModel]) -> str:
    return unknown_key(str(loc[-1]), _known_keys(loc[:-1], model))


def _known_keys(loc: Sequence[int | str], model: type[BaseModel]) -> list[str]:
    """The keys that the schema knows at a location."""
    schema = model.model_json_schema(by_alias=True)
    definitions = schema.get("$defs", {})

    def resolve(node: dict[str, Any], tag: str | None = None) -> dict[str, Any]:
        while "$ref" in node or "discriminator" in node or "anyOf" in node or "allOf" in node:
            if "$ref" in node:
                node = definitions[node["$ref"].rsplit("/", 1)[1]]
            elif "discriminator" in node:
                mapping = node["discriminator"]["mapping"]
                if tag not in mapping:
                    return {}
                node = {"$ref": mapping[tag]}
            else:
                options = node.get("anyOf") or node["allOf"]
                refs = [
                    o
                    for o in options
                    if "discriminator" in o or "$ref" in o or o.get("type") == "object"
                ]
                node = refs[0] if refs else {}
        return node

    node: dict[str, Any] = schema
    parts = [str(part) if isinstance(part, str) else 0 for part in loc]
    for n, part in enumerate(parts):
        tag = next((p for p in parts[n + 1 : n + 2] if isinstance(p, str)), None)
        if isinstance(part, int):
            node = resolve(node.get("items", {}), tag)
        elif part in node.get("properties", {}):
            node = resolve(node["properties"][part], tag)
            if node.get("type") == "array":
                continue
        elif "patternProperties" in node:
            (named,) = node["patternProperties"].values()
            node = resolve(named, tag)
    return sorted(node.get("properties", {}))


def _shown(value: object) -> str:
    if value == MISSING:
        return MISSING
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= 80 else text[:77] + "..."
