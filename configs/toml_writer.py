"""Write the TOML that a scenario needs: tables, arrays of tables, scalars and lists of them.

The standard library reads TOML and doesn't write it. Whoever reads the text back gets equal values:
floats are written with all their digits.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any


def dump(table: Mapping[str, Any], path: str = "") -> str:
    """TOML text of a table of JSON-like values (no None)."""
    lines = [f"{key} = {_inline(value)}" for key, value in table.items() if _is_plain(value)]
    text = "\n".join(lines) + "\n" if lines else ""
    for key, value in table.items():
        name = f"{path}{key}"
        if isinstance(value, Mapping):
            text += f"\n[{name}]\n" + dump(value, f"{name}.")
        elif not _is_plain(value):
            for item in value:
                text += f"\n[[{name}]]\n" + dump(item, f"{name}.")
    return text


def _is_plain(value: object) -> bool:
    if isinstance(value, Mapping):
        return False
    if isinstance(value, Sequence) and not isinstance(value, str):
        return not value or not isinstance(value[0], Mapping)
    return True


def _inline(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, float | int):
        return repr(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(_inline(item) for item in value) + "]"
    raise TypeError(f"no TOML for {value!r}")
