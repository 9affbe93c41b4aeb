"""`fleetloop fault kinds [KIND]`: the table of kinds, made of their classes."""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from itertools import groupby
from operator import itemgetter
from typing import Any

from rich.table import Table

from configs.faults.kinds import GROUPS, KINDS, class_of
from configs.tables import adapter_of
from fleetloop.terminal import ResultConsole, say, say_json

_COMMON = ("kind", "name", "at_s", "for_s")
_BOUNDS = {
    "minimum": "≥ {}",
    "exclusiveMinimum": "> {}",
    "maximum": "≤ {}",
    "exclusiveMaximum": "< {}",
}
_NEEDS = {"powertrain": "drive.preset = 'realistic'", "wire": "bus.timing = 'wire'"}


def print_kinds(kind: str | None, *, as_json: bool) -> None:
    """Print all kinds, or the parameters of one.

    Raises:
        ScenarioError: there is no such kind.
    """
    if kind is not None:
        described = [describe(kind)]
    else:
        described = [describe(one) for one in KINDS]
    if as_json:
        say_json(described)
    elif kind is None:
        _print_all(described)
    else:
        _print_one(described[0])


def describe(kind: str) -> dict[str, Any]:
    """A kind with its parameters: keys (with units), bounds, defaults and descriptions.

    Raises:
        ScenarioError: there is no such kind.
    """
    made = class_of(kind)
    schema = adapter_of(made).json_schema()["properties"]
    wanted = [one for one in fields(made) if one.name not in _COMMON]
    return {
        "kind": kind,
        "group": next(name for name, classes in GROUPS.items() if made in classes),
        "about": " ".join((made.__doc__ or "").split()),
        "acts_on": made.PLACE,
        "instant": made.INSTANT,
        "needs": [_NEEDS[model] for model in sorted(made.NEEDS)],
        "parameters": [
            {
                "key": one.name,
                "values": _values(schema[one.name]),
                "default": None if one.default is MISSING else one.default,
                "about": one.metadata.get("description", ""),
            }
            for one in wanted
        ],
    }


def _print_all(described: Sequence[Mapping[str, Any]]) -> None:
    table = Table(box=None, pad_edge=False)
    for column in ("kind", "what", "parameters"):
        table.add_column(column, no_wrap=True)
    for group, kinds in groupby(described, key=itemgetter("group")):
        table.add_row(f"[bold]{group}[/bold]")
        for one in kinds:
            keys = ", ".join(it["key"] for it in one["parameters"])
            table.add_row(f"  {one['kind']}", one["about"], keys)
    ResultConsole().print_whole(table)


def _print_one(kind: Mapping[str, Any]) -> None:
    say(f"{kind['kind']}: {kind['about']}")
    when = "at an instant: no for_s" if kind["instant"] else "for_s seconds, or to the end"
    say(f"  acts {when}{''.join(f'; needs {it}' for it in kind['needs'])}")
    if not kind["parameters"]:
        return
    table = Table(box=None, pad_edge=False)
    for column in ("key", "values", "default", "about"):
        table.add_column(column, no_wrap=True)
    for one in kind["parameters"]:
        default = "-" if one["default"] is None else str(one["default"])
        table.add_row(one["key"], one["values"], default, one["about"])
    ResultConsole().print_whole(table)


def _values(schema: Mapping[str, Any]) -> str:
    """The values that a key takes, in words."""
    options = [one for one in schema.get("anyOf", [schema]) if one.get("type") != "null"]
    return " or ".join(map(_of_option, options))


def _of_option(schema: Mapping[str, Any]) -> str:
    if "enum" in schema:
        return " or ".join(map(str, schema["enum"]))
    if schema.get("type") == "array":
        return "list of texts"
    word = {"number": "number", "integer": "whole number", "string": "text"}.get(
        schema.get("type", ""), "value"
    )
    bounds = [form.format(_number(schema[key])) for key, form in _BOUNDS.items() if key in schema]
    return ", ".join([word, *bounds])


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"
