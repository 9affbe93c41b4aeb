"""What the schema has against a file, in the words of the file: key, value, what would be right."""

import copy
import difflib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from configs.cross_checks import Problem
from configs.scenario import Scenario

MISSING = "(missing)"
_NOTHING = object()


def line(name: str, problem: Problem) -> str:
    """One line for people."""
    return f"{name}: {problem.key} = {_shown(problem.value)}: {problem.right}"


def complaints(
    error: ValidationError, data: dict[str, Any], model: type[BaseModel] = Scenario
) -> list[Problem]:
    """All that pydantic has against the parsed file `data`, which should be a `model`."""
    return [_problem(dict(item), data, model) for item in error.errors(include_url=False)]


def salvage(error: ValidationError, data: dict[str, Any]) -> Scenario | None:
    """The scenario without what is wrong in it, so that the rest can be checked as well."""
    rest = copy.deepcopy(data)
    for item in error.errors(include_url=False):
        _remove(rest, item["loc"])
    try:
        return Scenario.model_validate(rest)
    except ValidationError:
        return None


def _remove(data: Any, loc: Sequence[int | str]) -> None:
    holder = data
    for part in loc[:-1]:
        inner = _get(holder, part)
        # A discriminated union puts its tag into the location; it is no key of the file.
        holder = holder if inner is _NOTHING else inner
    if isinstance(holder, dict) and loc:
        holder.pop(loc[-1], None)


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
        if inner is _NOTHING and not last:
            continue  # the tag of a union
        if isinstance(part, int) and isinstance(inner, dict) and "name" in inner:
            names.append(str(inner["name"]))
        elif part != "schema_":
            names.append(str(part))
        holder = inner
    if item["type"] == "extra_forbidden":
        return Problem(".".join(names), item["input"], _unknown(loc, model))
    if item["type"].startswith("union_tag"):
        tag = item["ctx"].get("tag", MISSING)
        tags = item["ctx"].get("expected_tags", "")
        right = f"must be one of {tags}" if tags else "must be given"
        return Problem(".".join([*names, "kind"]), tag, right)
    value = MISSING if item["type"] == "missing" else item["input"]
    return Problem(".".join(names), value, _right(item))


def _unknown(loc: Sequence[int | str], model: type[BaseModel]) -> str:
    known = _known_keys(loc[:-1], model)
    close = difflib.get_close_matches(str(loc[-1]), known, 1, cutoff=0.5)
    hint = f"; did you mean {close[0]}?" if close else ""
    return f"unknown key{hint} (known here: {', '.join(known)})" if known else "unknown key"


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
                refs = [o for o in options if "$ref" in o or o.get("type") == "object"]
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


def _right(item: Mapping[str, Any]) -> str:
    if item["type"] == "missing":
        return "must be given"
    text = str(item["msg"]).removeprefix("Value error, ")
    text = text.removeprefix("Input ").removeprefix("String ")
    return text.replace("should", "must", 1)


def _shown(value: object) -> str:
    if value == MISSING:
        return MISSING
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= 80 else text[:77] + "..."
