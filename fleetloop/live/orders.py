"""What a viewer may ask of a run, and which viewer may. Pure.

    {"id": 7, "request": "run.step", "ticks": 10}

is an order of the page's script. The requests are those of the run's door, and few of the page's
own; anything else is refused here. One viewer has the controls: the first that asks while nobody
has them, or one that takes them over; orders of others are refused with the holder's name.
"""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from configs.errors import ScenarioError
from fleetloop.door.requests import mismatch

MOST_BYTES = 1 << 14
"""Of an order."""
TAKE, RELEASE, ESTOP = "controls.take", "controls.release", "estop"
"""The page's own requests."""
ARGUMENTS: Mapping[str, Mapping[str, type]] = {
    "run.pause": {},
    "run.resume": {},
    "run.step": {"ticks": int},
    "run.speed": {"factor": float},
    "run.leader_speed": {"speed_m_s": float, "ramp_s": float},
    "run.stop": {},
    "fault.inject": {"fault": dict},
    "fault.clear": {"names": list},
    ESTOP: {},
    TAKE: {},
    RELEASE: {},
}
"""The requests, each with its arguments."""


class Order(NamedTuple):
    """One order of a viewer."""

    number: int
    request: str
    arguments: dict[str, Any]


def parsed(text: object) -> Order:
    """An order of its text.

    Raises:
        ScenarioError: it is none; the text says why.
    """
    if not isinstance(text, str) or len(text) > MOST_BYTES:
        raise ScenarioError(f"an order is a text of at most {MOST_BYTES} characters")
    try:
        said = json.loads(text, parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        raise ScenarioError("an order is an object of JSON") from error
    number = said.pop("id", None) if isinstance(said, dict) else None
    if type(number) is not int:
        raise ScenarioError("an order is an object with a whole number as its id")
    request = said.pop("request", None)
    wanted = ARGUMENTS.get(request) if isinstance(request, str) else None
    if wanted is None:
        raise ScenarioError(f"{str(request)[:40]!r}: no such order")
    if wrong := mismatch(said, wanted):
        raise ScenarioError(f"{request}: {wrong}")
    return Order(number, request, said)


def _refused(constant: str) -> float:
    raise ValueError(f"{constant}: no number of JSON")


class Controls:
    """Which viewer has the controls."""

    def __init__(self) -> None:
        self.holder: str | None = None

    def take(self, viewer: str) -> None:
        """A viewer has them from now on."""
        self.holder = viewer

    def release(self, viewer: str) -> None:
        """A viewer lets go of them, if it has them."""
        if self.holder == viewer:
            self.holder = None

    def check(self, viewer: str) -> None:
        """Refuse an order of a viewer that doesn't have the controls.

        Raises:
            ScenarioError: nobody, or the viewer that is named, has them.
        """
        if self.holder == viewer:
            return
        if self.holder is None:
            raise ScenarioError("nobody has the controls; take them first")
        raise ScenarioError(f"{self.holder} has the controls")
