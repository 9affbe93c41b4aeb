"""Requests to a run, and what bounds them. Pure.

A request is a line of JSON, and so is its answer, which may come later than that of another request
of the same client:

    {"request": "fault.clear", "names": ["shove"], "id": 7}
    {"id": 7, "cleared": [...]}                              or {"id": 7, "error": "why not"}

`id` is the client's own and comes back as it was. A table of the requests is made by what serves
them: a request more is an entry there. Those that change the run are refused while another client
holds the controls (`fleetloop.door.controls`).
"""

import json
from collections.abc import Callable, Mapping
from math import isfinite
from types import MappingProxyType
from typing import Any, NamedTuple

from configs.errors import FleetloopError

MOST_LINE_BYTES = 1 << 16
"""Of a request."""

_NONE: Mapping[str, type] = MappingProxyType({})
Answer = dict[str, Any]
Respond = Callable[[Answer], None]
"""Called once with the answer, at once or later."""


class Request(NamedTuple):
    """One request: the arguments that it takes, and what carries it out."""

    arguments: Mapping[str, type]
    """By name; each must be given and be of this type."""
    act: Callable[..., None]
    """Called with `respond` and the arguments by name; raises FleetloopError to refuse."""
    changes: bool = False
    """It changes the run."""
    optional: Mapping[str, type] = _NONE
    """Arguments that may be left out."""


def serve(
    line: bytes,
    requests: Mapping[str, Request],
    respond: Respond,
    refuse: Callable[[], str] = lambda: "",
) -> None:
    """Carry out the request in a line; whatever is in it, there is one answer.

    `refuse`: why the client may not change the run now, "" if it may.
    """
    asked = _parsed(line)
    if isinstance(asked, str):
        respond({"error": asked})
        return
    echo = {"id": asked.pop("id")} if "id" in asked else {}

    def answer(said: Answer) -> None:
        respond(echo | said)

    name = asked.pop("request", None)
    request = requests.get(name) if isinstance(name, str) else None
    if request is None:
        answer({"error": f"{str(name)[:40]!r}: no such request; known: {', '.join(requests)}"})
    elif wrong := mismatch(asked, request.arguments, request.optional) or (
        refuse() if request.changes else ""
    ):
        answer({"error": f"{name}: {wrong}"})
    else:
        try:
            request.act(answer, **asked)
        except FleetloopError as error:
            answer({"error": str(error)})


def _parsed(line: bytes) -> Answer | str:
    try:
        asked = json.loads(line)
    except (ValueError, RecursionError):
        return "not a line of JSON"
    return asked if isinstance(asked, dict) else "must be an object with a key 'request'"


def mismatch(
    asked: Answer, arguments: Mapping[str, type], optional: Mapping[str, type] = _NONE
) -> str:
    """Why these aren't a request's arguments, "" if they are; a whole number becomes a float."""
    wanted: dict[str, type] = {**arguments, **optional}
    if not arguments.keys() <= asked.keys() <= wanted.keys():
        return f"takes {', '.join(wanted) or 'no arguments'}, not {', '.join(asked) or 'none'}"
    for key, value in asked.items():
        kind = wanted[key]
        if kind is float and type(value) is int and abs(value) <= 1 << 53:
            asked[key] = float(value)  # JSON has one kind of number
        elif type(value) is not kind:
            return f"{key} must be of type {kind.__name__}"
        elif isinstance(value, float) and not isfinite(value):
            return f"{key} must be a finite number"
    return ""
