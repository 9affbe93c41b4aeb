"""Changes of a loaded scenario, from a program: what `--set` does, and then the same checks.

control={"k1": 3.0}                     a table is changed key by key
{"control.k1": 3.0}                     the same, dotted
robot={"r2": {"pose": {"x_m": -6.5}}}   members of lists by name (or number)
path={"kind": "circle", ...}            a table of another kind replaces the one that is there
expect=[...]                            anything else replaces what is there
until_s=None                            None takes a key, or a member of a list, away
"""

import copy
from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePath
from typing import Any

from pydantic import BaseModel

from configs.errors import ScenarioError
from configs.overrides import Override, find
from configs.parameters import Parameters
from configs.tables import adapter_of

KIND = "kind"


def overrides_of(changes: Iterable[tuple[str, object]], data: Mapping[str, Any]) -> list[Override]:
    """Changes, keys with values, as overrides of the parsed file `data`, a key each.

    Raises:
        ScenarioError: a key is changed twice.
    """
    made: dict[str, Override] = {}
    for key, value in changes:
        if not isinstance(key, str):
            raise TypeError(f"with_({{{key!r}: ...}}): a key is a text, as 'control.k1'")
        for one in _flat(key, value, _inside(data, key.split("."))):
            if one.key in made:
                both = f"{made[one.key].value!r} and {one.value!r}"
                raise ScenarioError(f"{one.key}: changed twice, to {both}: name it once")
            made[one.key] = one
    return list(made.values())


def _flat(key: str, value: object, there: object) -> Iterator[Override]:
    if isinstance(value, Mapping) and not _is_of_another_kind(value, there):
        for name, inner in value.items():
            yield from _flat(f"{key}.{name}", inner, _inside(there, [str(name)]))
    else:
        made = plain(value)
        yield Override(f"{key} = {made!r}", key, made)


def _is_of_another_kind(table: Mapping[str, object], there: object) -> bool:
    kind = there.get(KIND) if isinstance(there, Mapping) else None
    return kind is not None and table.get(KIND, kind) != kind


def _inside(holder: object, path: list[str]) -> object:
    """What is there, None if nothing is."""
    for part in path:
        if isinstance(holder, Mapping):
            holder = holder.get(part)
        elif isinstance(holder, list):
            at = find(holder, part)
            holder = None if at is None else holder[at]
        else:
            return None
    return holder


def plain(value: object) -> Any:
    """A value as parsed TOML has it: a section's object as a table, numpy's numbers as Python's."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", by_alias=True, exclude_none=True)
    if isinstance(value, Parameters):
        adapter = adapter_of(type(value))
        return adapter.dump_python(value, mode="json", by_alias=True, exclude_none=True)
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, PurePath):
        return str(value)
    tolist = getattr(value, "tolist", None)  # numpy isn't imported for it
    return tolist() if callable(tolist) else copy.deepcopy(value)
