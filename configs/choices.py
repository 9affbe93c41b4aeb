"""Tables of a file whose keys depend on a name in them: of a law, an own shape, a drive protocol.

    [control]                [path]                       [drive]
    law = "my_law:MyLaw"     kind = "my_paths:Clover"     protocol = "my_drive:ROW"
    k = 2.0                  radius_m = 3.0               torque_unit_shaft_N_m = 1e-3

The name leads to a class (`configs.plugins`), the class to its parameters, and these are validated
like any other section: unknown keys, types, bounds. Where the file is, is in the context of the
validation: {"folder": ...}; {"recorded": True} takes classes that aren't here as they come.
"""

import contextlib
from collections.abc import Collection, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from configs.parameters import Parameters, as_tuples
from configs.plugins import (
    Choice,
    Kind,
    Plugin,
    PluginError,
    Recorded,
    entry_points,
    file_of,
    find,
    load,
)
from configs.tables import adapter_of, in_words, origin_of, stated, validated
from configs.wording import remedy_of

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
    from pydantic_core import core_schema


_P = TypeVar("_P", bound=Parameters)
_NAMES = {"name", "kind"}
"""Keys that are mistaken for that which holds the name."""


class Chooser(NamedTuple):
    """Makes a table a `Choice`: annotates it in a model."""

    kind: Kind
    key: str  # that holds the name
    shipped: Mapping[str, str]
    default: str = ""  # the name if there is none
    shared: type[Parameters] = Parameters  # what all parameters derive from

    def choose(self, table: Mapping[str, Any], folder: str, *, recorded: bool = False) -> Choice:
        """The choice that a table makes.

        Raises:
            ValidationError: of the table's keys.
        """
        rest = {key: as_tuples(value) for key, value in table.items() if key != self.key}
        name = table.get(self.key, self.default)
        if not isinstance(name, str) or not name:
            raise stated(self.key, name, "must be a text, the name of a " + self.kind.word)
        try:
            plugin = find(self.kind, name, folder, self.shipped)
            if recorded and plugin.folder == folder and name not in self.shipped:
                return Choice(plugin, Recorded(tuple(rest.items())))
            parameters = parameters_of(plugin)
        except PluginError as error:
            if recorded:
                return Choice(Plugin(self.kind, name, name), Recorded(tuple(rest.items())))
            raise stated(self.key, name, str(error)) from error
        beside = (self.key,)
        return Choice(
            plugin, validated(parameters, rest, beside, lambda key: self._of_another(key, name))
        )

    def _of_another(self, key: str, name: str) -> str:
        """What to do about a key that shipped classes have and the class `name` hasn't."""
        if key in _NAMES:
            return f"; did you mean {self.key}?"
        owners = [
            other
            for other in self.shipped
            if key in keys_of(parameters_of(find(self.kind, other, "", self.shipped)))
        ]
        return f": {name} doesn't have this key of {owners[0]}; delete it" if owners else ""

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        """Tables become choices, and are written as tables."""
        from pydantic_core import core_schema

        def made(value: Any, info: "core_schema.ValidationInfo") -> Choice:
            if isinstance(value, Choice):
                return value
            if not isinstance(value, Mapping):
                raise in_words("must be a table")
            folder, recorded = origin_of(info)
            return self.choose(value, folder, recorded=recorded)

        return core_schema.with_info_plain_validator_function(
            made,
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda choice: table_of(choice, self.key), return_schema=core_schema.any_schema()
            ),
        )

    def __get_pydantic_json_schema__(self, schema: Any, handler: "GetJsonSchemaHandler") -> Any:
        """The keys of a shipped choice; all keys of any other, and those that choices share."""
        about = f'a shipped {self.kind.word}, or "{self.kind.form}" of your own'
        names = [*self.shipped]
        key: dict[str, Any] = {"type": "string", "description": about, "examples": names}
        if self.default:
            key["default"] = self.default
        cases = []
        for name in self.shipped:
            parameters = parameters_of(find(self.kind, name, "", self.shipped))
            keys = _described(parameters)
            case: dict[str, Any] = {"properties": {self.key: {"const": name}}}
            if name != self.default:
                case["required"] = [self.key]
            then = {"properties": {self.key: True, **keys}, "additionalProperties": False}
            cases.append({"if": case, "then": then})
        shared = _described(self.shared) if keys_of(self.shared) else {}
        made: dict[str, Any] = {"type": "object", "properties": {self.key: key, **shared}}
        if cases:
            made["allOf"] = cases
        if not self.default:
            made["required"] = [self.key]
        return made


@dataclass(frozen=True, slots=True)
class AlsoOwn:
    """Annotation of a union of tables told apart by a key: a class of one's own is one more."""

    chooser: Chooser
    other: Kind
    """The kind whose names are mistaken for ours."""
    other_names: frozenset[str]
    """Names of the shipped ones of the other kind."""

    def _own_name(self, value: Any, shipped: Collection[str], *, recorded: bool) -> str:
        """The name in a table if it is no shipped one but leads elsewhere; else "".

        Raises:
            ValidationError: it is the name of the other kind.
        """
        key, kind = self.chooser.key, self.chooser.kind
        name = value.get(key) if isinstance(value, Mapping) else None
        if not isinstance(name, str) or name in shipped:  # most are, and packages are searched long
            return ""
        if any(mark in name for mark in (":", ".py")) or name in entry_points(kind):
            return name
        if name in self.other_names or name in entry_points(self.other):
            raise stated(key, name, f"is a {self.other.word}, no {kind.word}")
        return name if recorded else ""

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        """Tables of the union as before, others choices."""
        from pydantic_core import core_schema

        union: Any = handler(source)
        shipped = frozenset(union.get("choices", ()))

        def made(value: Any, inner: Any, info: "core_schema.ValidationInfo") -> Any:
            if isinstance(value, Choice):
                return value
            folder, recorded = origin_of(info)
            if self._own_name(value, shipped, recorded=recorded):
                return self.chooser.choose(value, folder, recorded=recorded)
            return inner(value)

        def written(value: Any, inner: Any) -> Any:
            own = isinstance(value, Choice)
            return table_of(value, self.chooser.key) if own else inner(value)

        return core_schema.with_info_wrap_validator_function(
            made,
            union,
            serialization=core_schema.wrap_serializer_function_ser_schema(written),
        )

    def __get_pydantic_json_schema__(
        self, schema: Any, handler: "GetJsonSchemaHandler"
    ) -> dict[str, Any]:
        """Of a class of one's own all keys."""
        name = {"type": "string", "pattern": ":", "description": '"module:Class" of your own'}
        own = {"type": "object", "properties": {self.chooser.key: name}}
        return {"anyOf": [handler(schema["schema"]), own | {"required": [self.chooser.key]}]}


def parameters_of(plugin: Plugin) -> type[Parameters]:
    """The type of a plugin's parameters.

    Raises:
        PluginError: the plugin can't be had, or a default is out of its own bounds.
    """
    found = load(plugin)
    parameters: type[Parameters] = found
    if plugin.kind is Kind.LAW:
        parameters = found.Gains
    elif plugin.kind is Kind.DRIVE:
        parameters = found.section
    try:
        adapter_of(parameters)
    except Exception as error:  # pydantic's, of annotations that it doesn't know
        raise PluginError(f"{parameters.__qualname__}: {str(error).splitlines()[0]}") from error
    hashable: Any = parameters
    _refuse_bad_defaults(hashable)
    return parameters


def keys_of(parameters: type[Parameters]) -> set[str]:
    """The keys of a table; none of `Parameters` itself."""
    return set(getattr(parameters, "__dataclass_fields__", ()))


def shared_part(shared: type[_P], parameters: Parameters) -> _P:
    """A choice's parameters as what all choices share; of a record's class just these keys."""
    if isinstance(parameters, shared):
        return parameters
    values = dict(parameters.values) if isinstance(parameters, Recorded) else {}
    known = {key: values[key] for key in keys_of(shared) & set(values)}
    made: _P = adapter_of(shared).validate_python(known)
    return made


def _described(parameters: type[Parameters]) -> dict[str, Any]:
    properties: dict[str, Any] = adapter_of(parameters).json_schema()["properties"]
    return properties


@lru_cache(maxsize=64)
def _refuse_bad_defaults(parameters: type[Any]) -> None:
    """Hold the defaults of a class to its own types and bounds.

    Raises:
        PluginError: a default that a file couldn't give.
    """
    from pydantic import ValidationError

    given = {
        one.name: as_tuples(one.default) for one in fields(parameters) if one.default is not MISSING
    }
    try:
        adapter_of(parameters).validate_python(given)
    except ValidationError as error:
        wrong = [
            f"the default of {item['loc'][0]} is {given[str(item['loc'][0])]!r:.80}, which"
            f" {remedy_of(item)}"
            for item in error.errors(include_url=False)
            if item["loc"] and item["loc"][0] in given
        ]
        if wrong:
            where = f"{file_of(parameters)}: {parameters.__qualname__}"
            raise PluginError(f"{where}: {'; '.join(wrong)}") from error
    except Exception:  # of its __post_init__, which is told of the values of files
        pass


@dataclass(frozen=True, slots=True)
class Changes:
    """Keys of a table that a robot has differently from the fleet's; validated together with it."""

    table: dict[str, Any]
    folder: str = field(default="", compare=False)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        """Any table."""
        from pydantic_core import core_schema

        def made(value: Any, info: "core_schema.ValidationInfo") -> Changes:
            if isinstance(value, cls):
                return value
            if not isinstance(value, Mapping):
                raise in_words("must be a table")
            return cls(dict(value), origin_of(info)[0])

        return core_schema.with_info_plain_validator_function(
            made,
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda changes: changes.table, return_schema=core_schema.any_schema()
            ),
        )

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: "GetJsonSchemaHandler") -> Any:
        """Any table."""
        return {"type": "object"}


def chosen_anew(choice: Choice, chooser: Chooser, changes: Changes) -> Choice:
    """What a robot says differently of the fleet's choice.

    With another class it keeps the parameters that both classes have from a common one.

    Raises:
        ValidationError: of the keys of `changes`.
    """
    if not changes.table:
        return choice
    name = changes.table.get(chooser.key, choice.name)
    if isinstance(choice.parameters, Recorded):
        merged = {**dict(choice.parameters.values), **changes.table}
        merged.pop(chooser.key, None)
        return Choice(Plugin(chooser.kind, name, name), Recorded(tuple(merged.items())))
    kept: dict[str, Any] = {}
    if isinstance(name, str):
        with contextlib.suppress(PluginError):  # said by `choose`
            plugin = find(chooser.kind, name, changes.folder, chooser.shipped)
            common = _common(type(choice.parameters), parameters_of(plugin))
            kept = {name: getattr(choice.parameters, name) for name in common}
    return chooser.choose({chooser.key: name, **kept, **changes.table}, changes.folder)


def _common(one: type[Parameters], other: type[Parameters]) -> list[str]:
    """Names of the fields of the nearest class that both derive from."""
    nearest = next(base for base in one.__mro__ if issubclass(other, base))
    return [one.name for one in fields(nearest)] if is_dataclass(nearest) else []


def table_of(choice: Choice, key: str) -> dict[str, Any]:
    """The table of a file that makes this choice, all defaults written out."""
    if isinstance(choice.parameters, Recorded):
        return {key: choice.name, **dict(choice.parameters.values)}
    adapter = adapter_of(type(choice.parameters))
    table: dict[str, Any] = adapter.dump_python(choice.parameters, mode="json", exclude_none=True)
    return {key: choice.name, **table}
