"""Pages of the files that people write: scenario, deployment, and the choices in a scenario."""

import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any

from bridge.drives.interface import EndpointFile
from configs.deployment import Deployment
from configs.drives import DRIVES
from configs.faults.kinds import CLASSES, KINDS
from configs.loading import json_schema
from configs.plugins import LAWS, Kind, find, load
from configs.tables import adapter_of
from docs.generate.markdown import Schema, Tables, code, doc_block, prose, table
from fleetloop.fault.kinds import describe
from fleetloop.sweep.study import json_schema as study_schema
from fleetloop.tune.tuning import json_schema as tuning_schema

_ELSEWHERE = {
    "control": ("laws.md", "The law and its gains: keys and defaults are those of the law."),
    "drive": ("drives.md", "The drive protocol and its keys."),
    "fault": ("faults.md", "What goes wrong, when, and for how long."),
}
_CHANGES = "Changes"
_NO_TYPES = ("mapping", "default", "properties")
"""Keys of a schema whose values name no types of its own."""


def scenario_page() -> str:
    """Every section and key of a scenario file."""
    schema = json_schema()
    return _Page(schema).text()


def deployment_page() -> str:
    """Every key of a deployment file."""
    return _Page(Deployment.model_json_schema(by_alias=True)).text()


def study_page() -> str:
    """Every key of a study file."""
    return _Page(study_schema()).text()


def tuning_page() -> str:
    """Every key of a tuning file."""
    return _Page(tuning_schema()).text()


class _Page:
    """The sections of a file: a table each, with the tables that it has inside below it."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema
        self._types: Mapping[str, Schema] = schema["$defs"]
        self._titles = dict(self._titled())
        self._tables = Tables({name: f"#{slug(title)}" for name, title in self._titles.items()})

    def text(self) -> str:
        sections = [
            self._section(key, about)
            for key, about in self._schema["properties"].items()
            if not _is_plain(about)
        ]
        plain = {k: v for k, v in self._schema["properties"].items() if _is_plain(v)}
        first = self._tables.keys({**self._schema, "properties": plain})
        return "\n".join(["## At the top", "", first, *sections])

    def _titled(self) -> Iterator[tuple[str, str]]:
        """(type, heading) of each type that has a table of its own."""
        for key, about in self._schema["properties"].items():
            if _is_plain(about) or key in _ELSEWHERE:
                continue
            for name in _named(about):
                one = len(set(_named(about))) == 1
                yield name, _header(key, about) if one else f"{key}: {self._kind(name)}"
        known = {n for k, a in self._schema["properties"].items() for n in _named(a)}
        for key, about in self._schema["properties"].items():
            if key in _ELSEWHERE:
                continue
            for name in self._inside(about):
                if name not in known and not name.endswith(_CHANGES):
                    known.add(name)
                    yield name, f"{key}: {self._kind(name)}"

    def _kind(self, name: str) -> str:
        """The kinds of a type's tables, or its name in words."""
        about = self._types[name]["properties"].get("kind", {})
        kinds = about.get("enum") or [about["const"]] if about else []
        words = re.sub(r"(?<=[a-z])([A-Z])", r" \1", name).lower()
        return ", ".join(f"`{kind}`" for kind in kinds) or words

    def _inside(self, about: Any) -> Iterator[str]:
        """Types that a key's tables name, at any depth, in their order."""
        for name in _named(about):
            yield name
            yield from self._inside({"properties": self._types[name].get("properties", {})})

    def _section(self, key: str, about: Schema) -> str:
        if key in _ELSEWHERE:
            page, words = _ELSEWHERE[key]
            return f"## {_header(key, about)}\n\n{words} [All of them]({page}).\n"
        names = list(dict.fromkeys(self._inside(about)))
        top = set(_named(about))
        lines = []
        if len(top) > 1:
            lines.append(f"## {_header(key, about)}\n\nOne of these, by its `kind`.\n")
        for name in names:
            if name in self._titles and self._is_of(name, key):
                level = "##" if top == {name} else "###"
                lines.append(self._type(name, level))
        return "\n".join(lines)

    def _is_of(self, name: str, key: str) -> bool:
        """Whether a type's table stands in this section: the first that names it."""
        for other, about in self._schema["properties"].items():
            if other not in _ELSEWHERE and name in self._inside(about):
                return bool(other == key)
        return False

    def _type(self, name: str, level: str) -> str:
        about = self._types[name]
        doc = prose(about.get("description"))
        tables = self._tables.keys(about, without=("kind",))
        return f"{level} {self._titles[name]}\n\n{doc}\n\n{tables}"


def _is_plain(about: Schema) -> bool:
    """Whether a key of the file is no table."""
    return not _named(about) and "allOf" not in about and "items" not in about


def _named(about: Any) -> list[str]:
    """Types that a schema names itself, without those inside them."""
    if isinstance(about, Mapping):
        if "$ref" in about:
            return [about["$ref"].rpartition("/")[2]]
        properties = about.get("properties")
        keys = properties if isinstance(properties, Mapping) else {}
        rest = [part for key, part in about.items() if key not in _NO_TYPES]
        parts = [*keys.values(), *rest]
    elif isinstance(about, list):
        parts = about
    else:
        return []
    return [name for part in parts for name in _named(part)]


def _header(key: str, about: Schema) -> str:
    if "items" in about:
        return f"`[[{key}]]`"
    if "patternProperties" in about or "additionalProperties" in about:
        return f"`[{key}.NAME]`"
    return f"`[{key}]`"


def slug(title: str) -> str:
    """The address of a heading, as GitHub and the site make it."""
    return re.sub(r"[^\w\- ]", "", title).lower().replace(" ", "-")


def laws_page() -> str:
    """Every shipped law with its gains and signals."""
    parts = []
    for name in LAWS:
        law = load(find(Kind.LAW, name, "", LAWS))
        about = doc_block(inspect.getmodule(law))
        gains = Tables({}).keys(adapter_of(law.Gains).json_schema())
        signals = table(
            ("signal", "unit", ""), [(f"`{s.name}`", s.unit, s.meaning) for s in law.SIGNALS]
        )
        where = f"Class `{law.__name__}` of `{law.__module__}`."
        recorded = f"It records\n\n{signals}" if law.SIGNALS else "It records the errors (8) only."
        parts.append(f"## `{name}`\n\n{where}\n\n{about}\n\n{gains}\n{recorded}")
    return "\n".join(parts)


def drives_page() -> str:
    """Every shipped drive protocol with its keys, errors and parameters on the bus."""
    parts = []
    for name in DRIVES:
        row = load(find(Kind.DRIVE, name, "", DRIVES))
        keys = Tables({}).keys(adapter_of(row.section).json_schema())
        errors = ", ".join(f"`{error}`" for error in row.section().errors())
        parts.append(
            f'## `protocol = "{name}"`\n\n{prose(row.section.__doc__)}\n\n{keys}\n'
            f"Errors with which an emulated drive can disarm (fault `drive_error`): {errors}.\n"
        )
        if row.endpoints is not None:
            parts.append(_endpoints(row.endpoints))
    return "\n".join(parts)


def _endpoints(of: EndpointFile) -> str:
    """Parameters of an emulated drive that a host reads and writes over the bus."""
    known: Any = of.contents(of.versions_of(None))["endpoints"]
    rows = [
        (f"`{path}`", str(about["id"]), about["type"], about.get("access", ""))
        for path, about in known.items()
    ]
    return (
        "### Endpoints\n\nNumbers are the emulation's own: see `fleetloop can endpoints`.\n\n"
        + table(("path", "number", "type", "access"), rows)
    )


def faults_page() -> str:
    """Every kind of fault with its parameters."""
    parts = []
    for cls in CLASSES:
        kinds = [kind for kind, of in KINDS.items() if of is cls]
        about = describe(kinds[0])
        when = "an instant, without `for_s`" if about["instant"] else "`for_s`, or to the end"
        needs = "".join(f" Needs {code_of(need)}." for need in about["needs"])
        keys = Tables({}).keys(
            adapter_of(cls).json_schema(), without=("kind", "name", "at_s", "for_s")
        )
        parts.append(
            f"## {', '.join(f'`{kind}`' for kind in kinds)}\n\n{about['about']}"
            f" Acts on: {about['acts_on']}; lasts {when}.{needs}\n\n{keys}"
        )
    return "\n".join(parts)


def code_of(words: str) -> str:
    """A setting in words, as code."""
    key, _, value = words.partition(" = ")
    return f"`{key} =` {code(value.strip(chr(39)))}"
