"""The laws of a comparison, and the scenario under each of them.

    fixed_dsc:factor=3:k4=2     a law, and gains that it has here and nowhere else
    my_law:Unicycle             one of the user's own, from my_law.py beside the scenario

All but `[control]` is the scenario's. Of a gain the value is, in this order: the one given with the
law, the scenario's (the fleet's or the robot's own) if the law has a gain of that name, the law's
default. A robot that names a law of its own takes part under the compared one.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from configs.choices import keys_of, parameters_of, table_of
from configs.errors import Complaint, ScenarioError
from configs.loading import loads, to_toml
from configs.overrides import Override
from configs.plugins import LAWS, Kind, PluginError, find
from configs.scenario import Scenario
from configs.sections import LAW
from configs.signals import (
    DERIVED_SIGNALS,
    PATH_ERRORS,
    PLANT_SIGNALS,
    SENT_SIGNALS,
    USED_SIGNALS,
)

_COMMA = re.compile(r",(?![^\[]*\])")
_OF_ALL_LAWS = {
    signal.name
    for signal in (
        *PLANT_SIGNALS,
        *USED_SIGNALS,
        *PATH_ERRORS,
        *SENT_SIGNALS,
        *DERIVED_SIGNALS,
    )
}
"""Signals that are recorded under any law."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A law of the comparison with the gains that it is given there."""

    label: str  # as it was given
    law: str
    gains: Mapping[str, object]


def contenders(text: str) -> tuple[Contender, ...]:
    """The laws that `--laws` names.

    Raises:
        ScenarioError: it names none, one twice, or gives a gain no value.
    """
    labels = [label for part in _COMMA.split(text) if (label := part.strip())]
    if not labels:
        raise ScenarioError(f"--laws {text!r}: names no law; for example adaptive_dsc,fixed_dsc")
    if twice := next((one for one in labels if labels.count(one) > 1), None):
        raise ScenarioError(f"--laws {text}: {twice} comes twice")
    return tuple(contender(label, f"--laws {label}") for label in labels)


def contender(label: str, option: str) -> Contender:
    """One law with its gains; `option` is what a complaint names.

    Raises:
        ScenarioError: it gives a gain no value.
    """
    parts = label.split(":")
    first = next((n for n, part in enumerate(parts) if "=" in part), len(parts))
    gains: dict[str, object] = {}
    for part in parts[first:]:
        override = Override.from_set(f"control.{part}")
        if isinstance(override, Complaint):
            raise ScenarioError(f"{option}: {part!r} must read gain=value")
        gains[override.key.removeprefix("control.")] = override.value
    return Contender(label, ":".join(parts[:first]), gains)


def scenario_under(
    scenario: Scenario,
    contender: Contender,
    *,
    folder: str,
    seed: int | None = None,
    option: str | None = None,
) -> Scenario:
    """The scenario with this law and seed, its expectations of signals that any law has.

    Args:
        scenario: as it was loaded.
        contender: the law.
        folder: where modules of the user's own are looked for first.
        seed: instead of the scenario's.
        option: named by complaints; `--laws` with the law if it isn't given.

    Raises:
        ScenarioError: the law can't be had, or a gain is wrong; it names the option.
    """
    option = option or f"--laws {contender.label}"
    known = _gains_of(contender.law, folder)
    fleet = _under(contender, known, table_of(scenario.control, LAW.key))
    overrides = [Override(option, "control", fleet)]
    for robot in scenario.robot:
        own = _under(contender, known, table_of(scenario.control_of(robot), LAW.key))
        differs = {key: value for key, value in own.items() if fleet.get(key) != value}
        overrides.append(Override(option, f"robot.{robot.name}.control", differs))
    if seed is not None:
        overrides.append(Override(f"--seeds {seed}", "seed", seed))
    data = tomllib.loads(to_toml(scenario))
    expect = [one for one in data.get("expect", ()) if one.get("signal") in {None, *_OF_ALL_LAWS}]
    overrides.append(Override(option, "expect", expect))
    return loads(scenario.name, to_toml(scenario), overrides, folder=folder)


def _gains_of(law: str, folder: str) -> set[str]:
    """Names of a law's gains; none of a law that can't be had, which is said by `loads`."""
    try:
        return keys_of(parameters_of(find(Kind.LAW, law, str(Path(folder).resolve()), LAWS)))
    except PluginError:
        return set()


def _under(contender: Contender, known: set[str], table: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in table.items() if key in known}
    return {LAW.key: contender.law, **kept, **contender.gains}


def gains_in_words(scenario: Scenario) -> str:
    """Gains of the fleet's law on one line."""
    table = table_of(scenario.control, LAW.key)
    gains = {key: value for key, value in table.items() if key != LAW.key}
    return ", ".join(f"{key} = {_value(value)}" for key, value in gains.items())


def _value(value: object) -> str:
    if isinstance(value, list) and len(set(map(str, value))) == 1 and len(value) > 1:
        return f"{len(value)} × {_value(value[0])}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
