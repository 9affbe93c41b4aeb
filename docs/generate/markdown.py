"""Markdown tables of the keys of a JSON Schema, as pydantic makes it of our dataclasses."""

import html
import inspect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from configs.parameters import MOST, MOST_INTEGER, MOST_S

Schema = Mapping[str, Any]

_UNITS = {
    "N_m_s_rev": "N·m·s/rev",
    "N_m_rev": "N·m/rev",
    "N_m_s": "N·m·s",
    "N_m_A": "N·m/A",
    "N_m": "N·m",
    "kg_m2": "kg·m²",
    "rad_s2": "rad/s²",
    "rev_s2": "rev/s²",
    "rad_s": "rad/s",
    "rev_s": "rev/s",
    "rad_m": "rad/m",
    "bit_s": "bit/s",
    "K_W": "K/W",
    "m_s": "m/s",
    "1_s2": "1/s²",
    "1_m2": "1/m²",
    "1_s": "1/s",
    "1_m": "1/m",
    "rad": "rad",
    "rev": "rev",
    "ohm": "Ω",
    "Hz": "Hz",
    "kg": "kg",
    "bytes": "bytes",
    "m": "m",
    "s": "s",
    "N": "N",
    "A": "A",
    "V": "V",
    "W": "W",
    "F": "F",
    "C": "°C",
    "K": "K",
}
_OTHERWISE = {
    "torque_slew_limit_wheel_N_m_s": "N·m/s",
    "counts_per_shaft_rev": "",
    **{f"gamma_{number}_s": "s" for number in (1, 2, 3)},
}
"""Where the end of a name has another meaning than in other names."""
_IN_WORDS = re.compile(r" ?\[(m|[^\]]*[·/²][^\]]*)\]$")
_BOUNDS = (
    ("exclusiveMinimum", "> {}"),
    ("minimum", "≥ {}"),
    ("exclusiveMaximum", "< {}"),
    ("maximum", "≤ {}"),
)
_UNBOUNDED = frozenset({MOST, -MOST, MOST_S, float(MOST_INTEGER)})
_WORDS = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "true or false",
    "object": "table",
}


def unit_of(key: str) -> str:
    """The unit in the name of a key, "" if there is none."""
    if key in _OTHERWISE:
        return _OTHERWISE[key]
    return next((unit for end, unit in _UNITS.items() if key.endswith(f"_{end}")), "")


def cell(text: str) -> str:
    """A text in one cell of a table."""
    parts = " ".join(text.split()).split("`")
    return "".join(_code(part) if n % 2 else _words(part) for n, part in enumerate(parts))


def _words(text: str) -> str:
    """Words with no HTML and no end of a cell in them."""
    return text.replace("<", "&lt;").replace("|", r"\|")


def _code(text: str) -> str:
    """Code; that a bar ends a cell or not, renderers of Markdown don't agree about."""
    if "|" not in text:
        return f"`{text}`"
    return f"<code>{html.escape(text, quote=False).replace('|', '&#124;')}</code>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; columns that are empty in every row are left out."""
    cells = [[cell(text) for text in row] for row in rows]
    kept = [n for n, _ in enumerate(head) if n == 0 or any(row[n] for row in cells)]
    lines = [
        [head[n] for n in kept],
        ["---"] * len(kept),
        *([row[n] for n in kept] for row in cells),
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def prose(doc: str | None) -> str:
    """A docstring, its paragraphs in a line each."""
    paragraphs = re.split(r"\n\s*\n", (doc or "").strip())
    return "\n\n".join(cell(paragraph).replace(r"\|", "|") for paragraph in paragraphs)


def doc_block(of: object) -> str:
    """A docstring with its tables and equations, as it stands."""
    return f"```text\n{inspect.getdoc(of)}\n```"


def code(value: object) -> str:
    """A value as a scenario file has it; "" for none."""
    return "" if value is None else f"`{_toml(value)}`"


def _toml(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return f'"{value}"'
        case float():
            return f"{value:g}" if value != int(value) or abs(value) >= 1e6 else f"{value:.1f}"
        case Mapping():
            given = {key: inner for key, inner in value.items() if inner is not None}
            inside = ", ".join(f"{key} = {_toml(inner)}" for key, inner in given.items())
            return f"{{ {inside} }}" if inside else "{}"
        case list() | tuple():
            return f"[{', '.join(map(_toml, value))}]"
    return str(value)


class Tables:
    """Tables of keys that link to the tables of the types they name.

    Args:
        links: address of each type of `$defs` that has a table.
    """

    def __init__(self, links: Mapping[str, str]) -> None:
        self.links = links

    def keys(self, schema: Schema, *, without: Sequence[str] = ()) -> str:
        """The table of a type's keys, but for some."""
        required = schema.get("required", ())
        rows = [
            self._row(key, about, required=key in required)
            for key, about in schema["properties"].items()
            if key not in without and about is not True
        ]
        return table(("key", "values", "unit", "default", ""), rows)

    def _row(self, key: str, about: Schema, *, required: bool) -> Sequence[str]:
        said = about.get("description", "")
        unit = _IN_WORDS.search(said)
        default = about.get("default")
        return (
            f"`{key}`",
            self.values(about),
            unit[1] if unit else unit_of(key),
            "*required*" if required else code(default),
            _IN_WORDS.sub("", said),
        )

    def values(self, schema: Schema) -> str:
        """The values that a key takes, in words."""
        options = schema.get("anyOf") or schema.get("oneOf") or [schema]
        said = [self._option(one) for one in options if one.get("type") != "null"]
        return " or ".join(dict.fromkeys(said))

    def _option(self, schema: Schema) -> str:
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            return f"[table]({self.links[name]})" if name in self.links else "table"
        if "oneOf" in schema:
            return self.values(schema)
        if "const" in schema:
            return code(schema["const"])
        if "enum" in schema:
            return ", ".join(map(code, schema["enum"]))
        if schema.get("type") == "array":
            return self._array(schema)
        if "properties" in schema:
            return 'table with `kind = "module:Class"` of your own'
        word = _WORDS[schema["type"]]
        if "additionalProperties" in schema and schema["additionalProperties"] is not False:
            return f"table of {self.values(schema['additionalProperties'])}"
        return ", ".join([word, *bounds(schema)])

    def _array(self, schema: Schema) -> str:
        if "prefixItems" in schema:
            items = dict.fromkeys(map(self.values, schema["prefixItems"]))
            return f"array of {len(schema['prefixItems'])}: {' or '.join(items)}"
        return f"array: {self.values(schema['items'])}"


def bounds(schema: Schema) -> Iterator[str]:
    """The bounds of a number or a text; those beyond every robot are left out."""
    for key, form in _BOUNDS:
        if key in schema and float(schema[key]) not in _UNBOUNDED:
            yield form.format(_number(schema[key]))
    if "pattern" in schema:
        yield f"`{schema['pattern']}`"
    if "maxLength" in schema:
        yield f"{schema['maxLength']} characters"


def _number(value: float) -> str:
    return str(int(value)) if value == int(value) else f"{value:g}"
