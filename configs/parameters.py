"""Parameters of a file: fields of frozen dataclasses, each declared once.

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Motor(Parameters):
        torque_constant_N_m_A: Positive = parameter(0.05, "of the motor")

The name holds the unit, the annotation the type and its bounds (`annotated_types`), the field the
default and the description. The launcher validates files against these classes with pydantic,
which makes the JSON Schema of them as well. Processes receive the same objects, without pydantic.

pydantic is imported by the methods that it calls itself: in a process nothing does.
"""

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, make_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Optional, TypeVar, get_args

from annotated_types import Ge, Gt, Le

from configs import patterns
from configs.wording import STATED

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

MOST = 1e12
"""Beyond every quantity of a robot, and far enough from where products of floats are infinite."""
MOST_S = 1e9
"""Thirty years: all sums of times fit into 64 bits of nanoseconds."""
MOST_INTEGER = (1 << 53) - 1
"""What every reader of TOML and JSON takes exactly."""

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Pattern:
    """Annotation of a text: the regular expression that it matches, its largest length."""

    regex: str
    max_length: int | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        from pydantic import Field

        text = Field(pattern=self.regex, max_length=self.max_length)
        return handler(Annotated[source, text])


@dataclass(frozen=True, slots=True)
class Tagged:
    """Annotation of a union of tables: the key whose value tells which one a table is."""

    key: str

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        from pydantic import Field

        return handler(Annotated[source, Field(discriminator=self.key)])


@dataclass(frozen=True, slots=True)
class NameOrTable:
    """Annotation of a union of names (a `Literal`) and a type of tables.

    Args:
        remedy: of a value that is neither.
    """

    remedy: str

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        from pydantic import Discriminator, Tag

        names: Any
        table: Any
        names, table = get_args(source)

        def kind_of(value: Any) -> str | None:
            if isinstance(value, Mapping):
                return "table"
            return "name" if value in get_args(names) else None

        choice = Discriminator(
            kind_of,
            custom_error_type=STATED,
            custom_error_message="{remedy}",
            custom_error_context={"remedy": self.remedy},
        )
        union: Any = Annotated[names, Tag("name")] | Annotated[table, Tag("table")]
        return handler(Annotated[union, choice])


@dataclass(frozen=True, slots=True)
class FromText:
    """Annotation of a type that files have as a text."""

    def __get_pydantic_core_schema__(self, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        from pydantic import Field

        return handler(Annotated[source, Field(strict=False)])


Finite = Annotated[float, Ge(-MOST), Le(MOST)]
Positive = Annotated[float, Gt(0), Le(MOST)]
NotNegative = Annotated[float, Ge(0), Le(MOST)]
Seconds = Annotated[float, Gt(0), Le(MOST_S)]
SecondsOrZero = Annotated[float, Ge(0), Le(MOST_S)]
Seed = Annotated[int, Ge(0), Le(MOST_INTEGER)]
Name = Annotated[str, Pattern(patterns.NAME, max_length=32)]
Node = Annotated[int, Ge(0), Le(62)]
FilePath = Annotated[Path, FromText()]
Point = tuple[Finite, Finite]


def parameter(default: _T, description: str) -> _T:
    """A field with its default and what the name leaves unsaid of it, in a few words."""
    made: _T = field(default=default, metadata={"description": description})
    return made


class Parameters:
    """One table of a file: unknown keys are errors, numbers are finite, types don't change."""

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # of every subclass: it is a dataclass
    __pydantic_config__: ClassVar[dict[str, Any]] = {
        "extra": "forbid",
        "strict": True,
        "allow_inf_nan": False,
    }

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: type[Any], handler: "GetCoreSchemaHandler"
    ) -> Any:
        """Strict values in a table that may be a mapping, as files have it."""
        schema: Any = handler(source)
        table: Any = handler.resolve_ref_schema(schema)
        table["strict"] = False
        return schema


_P = TypeVar("_P", bound=Parameters)


def changes_of(name: str, section: type[Parameters]) -> type[Any]:
    """A table of the same keys as `section`, none required: what one robot has differently."""
    keys = [
        (key.name, Optional[key.type], field(default=None, metadata=key.metadata))  # noqa: UP045
        for key in fields(section)
    ]
    options = {"frozen": True, "slots": True, "kw_only": True}
    namespace = {"__doc__": section.__doc__, "__module__": section.__module__}
    return make_dataclass(name, keys, bases=(Parameters,), namespace=namespace, **options)


def changed(section: _P, changes: Parameters) -> _P:
    """The section with those keys of `changes` that are given."""
    given = {key.name: getattr(changes, key.name) for key in fields(changes)}
    return replace(section, **{k: v for k, v in given.items() if v is not None})


def extended(made: type[_P], section: Parameters, **derived: Any) -> _P:
    """A subclass of the section's type: what the section has, and what is derived."""
    return made(**{key.name: getattr(section, key.name) for key in fields(section)} | derived)


def base_of(base: type[_P], section: Parameters) -> _P:
    """Those keys of a section that it has from a base class."""
    return base(**{key.name: getattr(section, key.name) for key in fields(base)})


def as_tuples(value: Any) -> Any:
    """Parsed TOML with its arrays as tuples, as `Parameters` have them."""
    if isinstance(value, dict):
        return {key: as_tuples(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return tuple(as_tuples(inner) for inner in value)
    return value
