"""What every parameter of a file is made of: a field of a frozen dataclass, declared once.

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Motor(Parameters):
        torque_constant_N_m_A: Positive = parameter(0.05, "of the motor")

The name holds the unit, the annotation the type and its bounds (`annotated_types`), the field the
default and the description. The launcher validates files against these classes with pydantic,
which makes the JSON Schema of them as well. Processes receive the same objects, without pydantic.
"""

from dataclasses import field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from annotated_types import Ge, Gt, Le

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

MOST = 1e12
"""Beyond every quantity of a robot, and far enough from where products of floats are infinite."""
MOST_S = 1e9
"""Thirty years: all sums of times fit into 64 bits of nanoseconds."""
MOST_INTEGER = (1 << 53) - 1
"""What every reader of TOML and JSON takes exactly."""

Finite = Annotated[float, Ge(-MOST), Le(MOST)]
Positive = Annotated[float, Gt(0), Le(MOST)]
NotNegative = Annotated[float, Ge(0), Le(MOST)]
Seconds = Annotated[float, Gt(0), Le(MOST_S)]
SecondsOrZero = Annotated[float, Ge(0), Le(MOST_S)]
Seed = Annotated[int, Ge(0), Le(MOST_INTEGER)]

_T = TypeVar("_T")


def parameter(default: _T, description: str) -> _T:
    """A field with its default and what the name leaves unsaid of it, in a few words."""
    made: _T = field(default=default, metadata={"description": description})
    return made


class Parameters:
    """One table of a file: unknown keys are errors, numbers are finite, types don't change."""

    __slots__ = ()
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
