"""The remedy of an error in terms of a scenario file: of one that pydantic reports, of a name."""

from collections.abc import Mapping, Sequence
from typing import Any

from configs.patterns import WORDS

STATED = "stated"
"""The type of an error that is in our words already: in its context, under `remedy`."""

MISSING = "(missing)"
"""Stands for the value of a key that has none."""
_WORDS = {
    "missing": "must be given",
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be {ge} or more",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be {le} or less",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_parsing": "must be a whole number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "int_parsing_size": "is too large",
    "bool_type": "must be true or false",
    "string_type": "must be a text",
    "path_type": "must be a text, the path of a file",
    "string_too_short": "must not be empty",
    "string_too_long": "must have {max_length} characters or fewer",
    "literal_error": "must be {expected}",
    "tuple_type": "must be a list",
    "too_short": "must have {min_length} entries or more",
    "too_long": "must have {max_length} entries or fewer",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dataclass_type": "must be a table",
}


def remedy_of(item: Mapping[str, Any]) -> str:
    """The remedy of one error, in a few words."""
    kind, about = item["type"], item.get("ctx", {})
    if kind == "value_error":
        return str(about["error"])
    if kind == STATED:
        return str(about["remedy"])
    if kind == "string_pattern_mismatch":
        return WORDS.get(about["pattern"], f"must match {about['pattern']}")
    shown = {k: f"{v:g}" if isinstance(v, float) else v for k, v in about.items()}
    return _WORDS.get(kind, "is of the wrong kind").format(**shown)


def unknown_key(key: str, known: Sequence[str], hint: str = "") -> str:
    """The remedy of a key that a table doesn't have; `hint` instead of a guess at what is meant."""
    if not known:
        return "unknown key"
    return f"unknown key{hint or guess(key, known)} (known here: {', '.join(known)})"


def guess(name: str, known: Sequence[str], cutoff: float = 0.6) -> str:
    """The known name that is meant perhaps, to go on a remedy; nothing if none is like it."""
    import difflib

    close = difflib.get_close_matches(name, known, 1, cutoff)
    return f"; did you mean {close[0]}?" if close else ""
