"""A table of a file as the parameters of a class: pydantic's part, its complaints in our words."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from configs.parameters import Parameters
from configs.wording import STATED, unknown_key

if TYPE_CHECKING:
    from pydantic import TypeAdapter, ValidationError
    from pydantic_core import InitErrorDetails, core_schema

_adapters: "dict[type[Parameters], TypeAdapter[Any]]" = {}


def adapter_of(parameters: type[Parameters]) -> "TypeAdapter[Any]":
    """What validates, writes and describes a class of parameters."""
    from pydantic import TypeAdapter

    if parameters not in _adapters:
        _adapters[parameters] = TypeAdapter(parameters)
    return _adapters[parameters]


def origin_of(info: "core_schema.ValidationInfo") -> tuple[str, bool]:
    """The folder of the file that is validated, and whether it is a record's."""
    context = info.context or {}
    return context.get("folder", ""), context.get("recorded", False)


def validated(
    parameters: type[Parameters],
    table: Mapping[str, Any],
    beside: Sequence[str] = (),
    hint: Callable[[str], str] = lambda _: "",
) -> Parameters:
    """The parameters that a table's keys make.

    Args:
        parameters: their class.
        table: without the keys `beside`, which are known as well.
        beside: keys of the table in the file that are no parameters.
        hint: what to do about an unknown key.

    Raises:
        ValidationError: of the keys; an unknown one is told with those that are known.
    """
    from pydantic import ValidationError

    known = sorted(one.name for one in fields(parameters))
    wrong = [
        _detail(key, value, unknown_key(key, [*beside, *known], hint(key)))
        for key, value in table.items()
        if key not in known
    ]
    made: Parameters | None = None
    try:
        made = adapter_of(parameters).validate_python(
            {key: value for key, value in table.items() if key in known}
        )
    except ValidationError as error:
        wrong = [_again(item) for item in error.errors(include_url=False)] + wrong
    except Exception as error:  # raised by the class itself, in its __post_init__
        text = f"{type(error).__name__}: {error}"
        raise in_words(text) from error
    if wrong or made is None:
        raise ValidationError.from_exception_data(parameters.__name__, wrong)
    return made


def stated(key: str, value: object, remedy: str) -> "ValidationError":
    """An error about one key that says just this."""
    from pydantic import ValidationError

    return ValidationError.from_exception_data(key, [_detail(key, value, remedy)])


def in_words(remedy: str) -> Any:
    """An error for pydantic that says just this."""
    from pydantic_core import PydanticCustomError

    return PydanticCustomError(STATED, "{remedy}", {"remedy": remedy})


def _detail(key: str, value: object, remedy: str) -> "InitErrorDetails":
    from pydantic_core import InitErrorDetails

    return InitErrorDetails(type=in_words(remedy), loc=(key,), input=value)


def _again(item: Any) -> "InitErrorDetails":
    from pydantic_core import InitErrorDetails

    again = InitErrorDetails(type=item["type"], loc=item["loc"], input=item["input"])
    if item["type"] == "value_error":
        again["type"] = in_words(str(item["ctx"]["error"]))
    elif "ctx" in item:
        again["ctx"] = item["ctx"]
    return again
