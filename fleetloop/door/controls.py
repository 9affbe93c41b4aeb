"""Who holds the controls of a run: one client of its door, while it is connected. Pure.

    request            arguments    answer
    controls.take      who, [force] controller: who holds them now
    controls.release   -            controller: who holds them now, or null

Without a holder any client may change the run, each request by itself. A client that takes them by
force lends them, as it were: once it lets go, or is gone, they are back with who had them.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from configs.errors import ScenarioError
from fleetloop.door.requests import Request, Respond

MOST_NAME = 80
"""Characters."""


class _Holder(NamedTuple):
    client: object
    who: str


class Controls:
    """The holders of one run's controls, the present one last."""

    def __init__(self) -> None:
        self._holders: list[_Holder] = []

    @property
    def controller(self) -> str | None:
        """Who holds them, None if nobody does."""
        return self._holders[-1].who if self._holders else None

    def requests_of(self, client: object) -> Mapping[str, Request]:
        """The requests of one client."""

        def take(respond: Respond, who: str, *, force: bool = False) -> None:
            self._take(client, who, force=force)
            respond(self._said())

        def release(respond: Respond) -> None:
            self.drop(client)
            respond(self._said())

        return {
            "controls.take": Request({"who": str}, take, optional={"force": bool}),
            "controls.release": Request({}, release),
        }

    def refusal(self, client: object) -> str:
        """Why a client may not change the run now, "" if it may."""
        if not self._holders or self._holders[-1].client is client:
            return ""
        return f"{self.controller} has the controls of this run"

    def drop(self, client: object) -> None:
        """A client lets go of them, or is gone."""
        self._holders = [one for one in self._holders if one.client is not client]

    def _take(self, client: object, who: str, *, force: bool) -> None:
        name = who.strip()
        if not name or len(name) > MOST_NAME or not name.isprintable():
            raise ScenarioError(f"controls.take: who must be a name of 1 to {MOST_NAME} characters")
        if not force and (refusal := self.refusal(client)):
            raise ScenarioError(f"controls.take: {refusal}")
        self.drop(client)
        self._holders.append(_Holder(client, name))

    def _said(self) -> dict[str, Any]:
        return {"controller": self.controller}
