"""Keys of a scenario that are set from outside its file, for example on the command line.

A complaint about such a value names the option, not the file.
"""

import copy
import re
import tomllib
from collections.abc import Sequence
from typing import Any, NamedTuple

from configs.errors import Complaint

_BARE = re.compile(r"[A-Za-z0-9_-]+")


class Override(NamedTuple):
    """One key and its value, instead of the file's."""

    option: str  # as it was given, for messages: "--seed -3"
    key: str  # dotted; members of lists by name or number: "robot.r2.pose.x_m"
    value: object  # None takes the key away

    @classmethod
    def from_set(cls, text: str) -> "Override | Complaint":
        """Override from `--set KEY=VALUE`; a value that isn't TOML is a text."""
        option = f"--set {text}"
        key, equals, value = text.partition("=")
        parts = [part.strip() for part in key.split(".")]
        if not equals or not all(parts):
            remedy = "must read key=value, for example coordination.p=3"
            return Complaint(option, "", text, remedy)
        return cls(option, ".".join(parts), _value(value.strip()))

    def is_about(self, key: str) -> bool:
        """Whether a key of a scenario is the one set here, or inside it."""
        return f"{key}.".startswith(f"{self.key}.")

    def apply(self, data: dict[str, Any]) -> "Override | Complaint":
        """Set the key in parsed TOML; return this with its members of lists by name.

        Tables on the way to it are copied: those of `data` may be others' as well. The error, if
        there is no such place.
        """
        *path, last = self.key.split(".")
        holder: Any = data
        names = []
        for part in path:
            place: int | str | None = part
            if isinstance(holder, dict):
                inner = holder.get(part, {})
                names.append(part)
            elif isinstance(holder, list):
                place = find(holder, part)
                if place is None:
                    return self._complain(f"no {part!r} there; known: {', '.join(_names(holder))}")
                inner = holder[place]
                names.append(_names(holder)[place])
            else:
                return self._complain(f"{part} is in no table")
            holder[place] = copy.copy(inner)
            holder = holder[place]
        if isinstance(holder, dict):
            holder[last] = self.value
            if self.value is None:
                del holder[last]
        elif isinstance(holder, list) and (at := find(holder, last)) is not None:
            if self.value is None:
                last = _names(holder)[at]
                del holder[at]
            else:
                holder[at] = self.value
                last = _names(holder)[at]  # what is no table any more has lost its name
        else:
            known = f"; known: {', '.join(_names(holder))}" if isinstance(holder, list) else ""
            return self._complain(f"{last} names nothing there{known}")
        return self._replace(key=".".join([*names, last]))

    def _complain(self, remedy: str) -> Complaint:
        return Complaint(self.option, "", self.value, remedy)


def _value(text: str) -> object:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def find(items: Sequence[Any], part: str) -> int | None:
    """The place of the member of a list that this name, or number, means."""
    for n, item in enumerate(items):
        if isinstance(item, dict) and item.get("name") == part:
            return n
    return int(part) if part.isdigit() and int(part) < len(items) else None


def _names(items: Sequence[Any]) -> list[str]:
    return [
        str(item.get("name", n)) if isinstance(item, dict) else str(n)
        for n, item in enumerate(items)
    ]


def inline(value: object) -> str:
    """A value as TOML has it on one line, as `--set` takes it."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            return f'"{escaped}"'
        case dict():
            pairs = (f"{_inline_key(key)}={inline(item)}" for key, item in value.items())
            return "{" + ", ".join(pairs) + "}"
        case list() | tuple():
            return "[" + ", ".join(map(inline, value)) + "]"
    return repr(value)


def _inline_key(key: str) -> str:
    return key if _BARE.fullmatch(key) else inline(key)


Overrides = tuple[Override | str, ...]
"""Several; a text is what `--set` takes."""
