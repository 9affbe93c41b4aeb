"""The kinds of faults as the form of a page needs them, made of their classes. Pure."""

from dataclasses import MISSING, fields
from typing import Any

from configs.edges import edge_text
from configs.faults.base import Fault
from configs.faults.kinds import KINDS
from configs.parameters import MOST_S
from configs.scenario import Scenario
from configs.tables import adapter_of
from fleetloop.fault.kinds import describe

_COMMON = ("kind", "name", "at_s", "for_s")


def kinds_of(scenario: Scenario) -> list[dict[str, Any]]:
    """Every kind that can be ordered while a run goes on, with its parameters."""
    targets = {
        "robots": list(scenario.names),
        "edges": [edge_text(edge) for edge in scenario.topology.edges],
    }
    return [
        {
            "kind": kind,
            "about": said["about"],
            "needs": said["needs"],
            "instant": said["instant"],
            "parameters": _parameters(made, said["parameters"], targets),
        }
        for kind, made in KINDS.items()
        if (said := describe(kind))["acts_on"] != "process"
    ]


def _parameters(
    made: type[Fault], described: list[dict[str, Any]], targets: dict[str, list[str]]
) -> list[dict[str, Any]]:
    schema = adapter_of(made).json_schema()["properties"]
    required = {one.name: one.default is MISSING for one in fields(made)}
    return [_parameter(one, schema[one["key"]], required[one["key"]], targets) for one in described]


def _parameter(
    described: dict[str, Any], schema: dict[str, Any], required: bool, targets: dict[str, list[str]]
) -> dict[str, Any]:
    """One field: its bounds, or the values that it may have."""
    options = [one for one in schema.get("anyOf", [schema]) if one.get("type") != "null"]
    (option, *_) = options
    key, many = described["key"], option.get("type") == "array"
    default = described["default"]
    return {
        "key": key,
        "about": described["about"],
        "values": "" if many or _unbounded(option) else described["values"],
        "default": None if many else default,
        "required": required,
        "number": option.get("type") in ("number", "integer"),
        "whole": option.get("type") == "integer",
        "minimum": option.get("minimum", option.get("exclusiveMinimum")),
        "maximum": option.get("maximum", option.get("exclusiveMaximum")),
        "choices": targets.get(key) if many else option.get("enum"),
        "many": many,
    }


def _unbounded(option: dict[str, Any]) -> bool:
    """Whether the bounds of a number are only those of all numbers of a file."""
    bounds = ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum")
    given = [option[key] for key in bounds if key in option]
    return all(abs(bound) >= MOST_S for bound in given)
