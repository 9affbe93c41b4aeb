"""Scenarios that differ from a right one in few keys: as if loaded whole, at a part of its cost.

Of a variant only what differs is validated, and only what depends on that is checked and computed
again. What depends on what is declared nowhere: each check is made of the base once, and the keys
that it reads are noted. Of a variant in which none of these differs it would read the same again,
and say the same: nothing, as the base is right.

Only right variants are made so. One that isn't is loaded whole, and said to be wrong as any is.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import cache, cached_property
from operator import attrgetter
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from configs.checks import Check, cross_problems
from configs.errors import Complaint, Problem
from configs.graph_inclusion import includes_graph
from configs.loading import context_of, of_data
from configs.origin import Origin
from configs.overrides import Override
from configs.parameters import as_tuples
from configs.plugins import Choice
from configs.scenario import Scenario
from configs.sections import Robot

_ROBOTS: Final = "robot"
_CONTROL: Final = "control"
_PARTS: Final = {"control.plugin": "plugin", "control.recorded": "recorded"}
"""Of the fleet's law, which most often only differs in its gains."""
_FIELDS: Final = {it.alias or name: name for name, it in Scenario.model_fields.items()}
"""Of a scenario, by the keys of its file."""
_COMPUTED: Final = tuple(
    name for name, it in vars(Scenario).items() if isinstance(it, cached_property)
)
"""What a scenario computes of its fields, once."""


class Variants:
    """The variants of a scenario.

    Args:
        base: the scenario.
        table: its file, parsed.
        overrides: with which it was loaded from that.
        folder: where modules of one's own are looked for first.
    """

    def __init__(
        self, base: Scenario, table: Mapping[str, Any], overrides: Sequence[Override], folder: str
    ) -> None:
        self._file, self._overrides, self._folder = table, tuple(overrides), folder
        self._context = context_of(folder)
        self._base, self._table = base, dict(table)
        for one in overrides:
            one.apply(self._table)
        self._values = {key: getattr(base, name) for key, name in _FIELDS.items()}
        self._reads: dict[Check, frozenset[str]] = {}
        cross_problems(base, self._note)
        self._reads_of_computed = {name: _reads(base, attrgetter(name)) for name in _COMPUTED}

    def scenario(self, name: str, overrides: Sequence[Override]) -> Scenario:
        """The variant with these overrides; `name` stands for its file in messages.

        Raises:
            ScenarioError: all that is wrong with it, a line each.
        """
        made = self._right(name, overrides)
        if made is None:
            every = [*self._overrides, *overrides]
            made = of_data(name, dict(self._file), every, self._folder)
        return made

    def _right(self, name: str, overrides: Sequence[Override]) -> Scenario | None:
        """The variant; None if something seems to be wrong with it."""
        data = dict(self._table)
        for one in overrides:
            if isinstance(one.apply(data), Complaint):
                return None
        if includes_graph(data):  # then its file counts, too
            return None
        keys = _unlike(data, self._table)
        if not keys <= _FIELDS.keys():
            return None
        try:
            valid = {key: self._validated(key, data) for key in keys}
        except ValidationError:
            return None
        given = {_FIELDS[key] for key in data}
        scenario = Scenario.model_construct(given, **{**self._values, **valid})
        differing = self._differing(data, keys)
        if _CONTROL in differing:
            differing |= _unlike_parts(scenario.control, self._base.control)

        def again(check: Check, scenario: Scenario, **how: bool) -> list[Problem]:
            same = self._reads[check].isdisjoint(differing)
            return [] if same else list(check(scenario, **how))

        for computed, reads in self._reads_of_computed.items():
            if reads.isdisjoint(differing):
                scenario.__dict__[computed] = getattr(self._base, computed)
        if cross_problems(scenario, again):
            return None
        return scenario.originating(Origin(name, self._folder, data))

    def _validated(self, key: str, data: Mapping[str, Any]) -> Any:
        """What a field is by the value of its key, or without one.

        Raises:
            ValidationError: the value is wrong, or must be given.
        """
        given = {key: self._known(key, data[key])} if key in data else {}
        return getattr(_alone(key).model_validate(given, context=self._context), _FIELDS[key])

    def _known(self, key: str, value: Any) -> Any:
        """What stands at a key of the file: validated already, as far as it is the base's."""
        there, known = self._table.get(key), self._values.get(key, ())
        if value is there:
            return known
        if there is not None and _alike(value, there):
            return tuple(
                after if one is other else as_tuples(one)
                for one, other, after in zip(value, there, known, strict=True)
            )
        return as_tuples(value)

    def _differing(self, data: Mapping[str, Any], keys: set[str]) -> set[str]:
        """The fields of keys in which a table differs from the base's, as `_reads` has them."""
        names = {_FIELDS[key] for key in keys}
        if _ROBOTS in names and _alike(data[_ROBOTS], self._table[_ROBOTS]):
            names.remove(_ROBOTS)
            for one, other in zip(data[_ROBOTS], self._table[_ROBOTS], strict=True):
                names |= {f"{_ROBOTS}.{key}" for key in _unlike(one, other)}
        return names

    def _note(self, check: Check, scenario: Scenario, **how: bool) -> list[Problem]:
        found: list[Problem] = []
        self._reads[check] = _reads(scenario, lambda it: found.extend(check(it, **how)))
        return found


@cache
def _alone(key: str) -> type[BaseModel]:
    """One field of a scenario by itself: no field is validated by another one's value."""
    name = _FIELDS[key]
    field = Scenario.model_fields[name]
    fields_of_it: dict[str, Any] = {name: (field.annotation, field)}
    return create_model(f"Scenario.{key}", __config__=Scenario.model_config, **fields_of_it)


def _alike(value: object, there: object) -> bool:
    """Whether both are lists of as many tables."""
    if not isinstance(value, list) or not isinstance(there, list) or len(value) != len(there):
        return False
    return all(isinstance(one, dict) for one in (*value, *there))


def _unlike(one: Mapping[str, Any], other: Mapping[str, Any]) -> set[str]:
    """Keys at which two tables don't hold the same object."""
    return {key for key in one.keys() | other.keys() if one.get(key) is not other.get(key)}


def _unlike_parts(one: Choice, other: Choice) -> set[str]:
    return {part for part, of in _PARTS.items() if getattr(one, of) != getattr(other, of)}


def _reads(scenario: Scenario, look: Callable[[Scenario], object]) -> frozenset[str]:
    """The fields of a scenario that a function reads; those of robots as "robot.pose".

    Of the fleet's law the class by itself is "control.plugin", what else is read of it "control".
    """
    noted: set[str] = set()
    fields_of_robots = {key.name for key in fields(Robot)}
    fields_of_choices = {key.name for key in fields(Choice)}

    class ReadRobot(Robot):
        __slots__ = ()

        def __getattribute__(self, name: str) -> Any:
            if name in fields_of_robots:
                noted.add(f"{_ROBOTS}.{name}")
            return super().__getattribute__(name)

    class ReadChoice(Choice):
        __slots__ = ()

        def __getattribute__(self, name: str) -> Any:
            part = f"{_CONTROL}.{name}"
            if part in _PARTS:
                noted.add(part)
                return getattr(scenario.control, name)
            if name in fields_of_choices:
                noted.add(_CONTROL)
            return super().__getattribute__(name)

    class ReadScenario(Scenario):
        model_config = ConfigDict(defer_build=True)

        def __getattribute__(self, name: str) -> Any:
            if name in Scenario.model_fields and name != _CONTROL:
                noted.add(name)
            return super().__getattribute__(name)

    robots = tuple(
        ReadRobot(**{name: getattr(robot, name) for name in fields_of_robots})
        for robot in scenario.robot
    )
    values = {key: getattr(scenario, name) for key, name in _FIELDS.items()}
    control = ReadChoice(scenario.control.plugin, scenario.control.parameters)
    look(ReadScenario.model_construct(**{**values, _ROBOTS: robots, _CONTROL: control}))
    return frozenset(noted)
