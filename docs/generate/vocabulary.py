"""Pages of what a run says: signals, events, messages, keys and rights."""

import inspect
import re
from typing import get_type_hints

from bridge.network import keys, messages
from configs import signals
from configs.events import KINDS
from configs.roles import ROLES, Role
from docs.generate.markdown import doc_block, prose, table
from fleetloop.door import controls, requests
from fleetloop.launch import fault_desk, run_status, steering, viewer

_KEY = re.compile(r"    (fleetloop/\S+) +(.*)")


def signals_page() -> str:
    """Every signal that is recorded of every robot, and those that are derived."""
    groups = (
        ("Of the plant", signals.PLANT_SIGNALS, "True state of a robot at a tick."),
        ("Of a controller: used", signals.USED_SIGNALS, "What a controller used at a tick."),
        ("Path following errors", signals.PATH_ERRORS, "Of every law."),
        ("Of a controller: commanded", signals.SENT_SIGNALS, "And how it kept its time."),
        (
            "Ages",
            signals.age_signals(("NAME",)),
            "Of every in-neighbour, where ages vary; of `leader` and `localisation`, where their"
            " edges are emulated.",
        ),
        ("Derived", signals.DERIVED_SIGNALS, "For expectations: made of the record."),
    )
    return "\n".join(f"## {title}\n\n{about}\n\n{_signals(rows)}" for title, rows, about in groups)


def _signals(rows: tuple[signals.Signal, ...]) -> str:
    return table(("signal", "unit", ""), [(f"`{s.name}`", s.unit, s.meaning) for s in rows])


def events_page() -> str:
    """Every kind of event."""
    rows = [
        (f"`{name}`", kind.meaning, "yes" if kind.exact else "", "yes" if kind.told else "")
        for name, kind in KINDS.items()
    ]
    return table(("kind", "", "exact", "said during the run"), rows)


def door_page() -> str:
    """Every request to a run that goes on."""
    parts = {
        "Lines": requests,
        "Status and events": run_status,
        "Time and speed": steering,
        "Faults": fault_desk,
        "Who holds the controls": controls,
        "The live page": viewer,
    }
    return "\n\n".join(f"## {title}\n\n{doc_block(of)}" for title, of in parts.items())


def network_page() -> str:
    """Keys, messages and rights of a run."""
    places = table(("key", ""), [(f"`{key}`", _said(about)) for key, about in _keys()])
    rows = [_message(message) for message in _messages()]
    fields = table(("message", "array", "most bytes", ""), rows)
    rights = table(("role", "puts", "hears", "started by a run"), [_role(role) for role in ROLES])
    return "\n".join(
        [
            "## Keys\n\nAngle brackets stand for a name: of a run, robot, bus, process or guest.\n",
            places,
            "## Messages\n\nmsgpack; the first element is the version of the layout.\n",
            fields,
            "## Rights\n\nThe router refuses all else. Each role that a run starts puts its"
            " progress, notices and last report as well. Keys: `bridge.network.access`.\n",
            rights,
        ]
    )


def _keys() -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    for line in (keys.__doc__ or "").splitlines():
        if match := _KEY.match(line):
            found.append((match[1], match[2]))
        elif found and line.startswith("    ") and line.strip():
            found[-1] = (found[-1][0], f"{found[-1][1]} {line.strip()}")
    return found


def _said(words: str) -> str:
    return words.replace("<", "`<").replace(">", ">`")


def _messages() -> list[type]:
    return [
        one
        for _, one in inspect.getmembers(messages, inspect.isclass)
        if one.__module__ == messages.__name__ and hasattr(one, "encode")
    ]


def _message(message: type) -> tuple[str, str, str, str]:
    fields = ", ".join(f"{name}: {_type(hint)}" for name, hint in get_type_hints(message).items())
    most = messages.MOST_BYTES.get(_kind(message.__name__), "")
    return f"`{message.__name__}`", f"`[1, {fields}]`", str(most), prose(message.__doc__)


def _type(hint: object) -> str:
    return getattr(hint, "__name__", str(hint)) if not getattr(hint, "__args__", ()) else "array"


def _kind(name: str) -> str:
    return {"PathState": "path", "PoseFix": "pose", "Rows": "truth"}.get(name, name.lower())


def _role(role: Role) -> tuple[str, str, str, str]:
    puts, hears = (
        ", ".join(topic.name.lower().replace("_", " ") for topic in topics)
        for topics in (role.puts, role.hears)
    )
    name = f"`{role.name}`" + (" per robot" if role.per_robot else "")
    return name, puts, hears, "yes" if role.module else ""
