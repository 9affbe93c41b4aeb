"""A run that goes on at a Foxglove WebSocket: what was heard of it, to those who look."""

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from configs.brief import Drawing
from configs.events import Event
from configs.signals import Signal
from fleetloop.foxglove.feed import Feed
from fleetloop.foxglove.server import FoxgloveServer
from fleetloop.record.events import log_message
from fleetloop.record.schema import View
from fleetloop.record.writer import Source

LIFETIME_NS = 2_000_000_000
"""Of what is drawn. A client takes a message to be as old as the last time that it was told, and in
a fast run a push is half a second after the one before: it must not vanish in between."""


class Stream:
    """One run; `push` sends what is new.

    What is said once, as paths and events, a client gets when it subscribes, and of the rest the
    newest, so that it sees a run that stands still.

    Args:
        run: its name.
        robots: in their order, each with the table of its controller's rows.
        drawing: for the views.
        period_ns: of the rows.

    Raises:
        InfrastructureError: it can't be served.
    """

    def __init__(
        self,
        run: str,
        robots: Mapping[str, Sequence[Signal]],
        drawing: Drawing,
        period_ns: int,
    ) -> None:
        self._feed = Feed(robots, drawing, period_ns, lifetime_ns=LIFETIME_NS)
        self._server = FoxgloveServer(self._feed.layout, run)
        self._period_ns = period_ns
        self._events: list[np.ndarray] = []
        self._told = 0  # of the events
        self._time_ns = -1
        self.address = self._server.address

    @property
    def watched(self) -> bool:
        """Whether anything is subscribed to."""
        return bool(self._server.wanted)

    def hear(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """Take a block of rows as it travels."""
        self._feed.hear(robot, source, first_tick, rows)

    def note_events(self, events: Iterable[Event]) -> None:
        """Take events that follow those that are there."""
        for event in events:
            self._events.append(log_message(event, len(self._events), self._period_ns))

    def push(self) -> None:
        """Send what is new to those who look."""
        wanted, newcomers = self._server.wanted, self._server.newcomers()
        missed = {client: self._missed(channels) for client, channels in newcomers.items()}
        new = [(View.LOG, it) for it in self._events[self._told :]]
        self._told = len(self._events)
        if not wanted:
            self._feed.skip()
            return
        messages = [*new, *self._feed.messages(wanted)]
        if newcomers or self._feed.time_ns > self._time_ns:
            self._time_ns = self._feed.time_ns
            self._server.tell_time(self._time_ns)
        for client, said in missed.items():
            self._server.send(said, client)
        self._server.send(messages)

    def _missed(self, channels: Collection[int]) -> list[tuple[int, np.ndarray]]:
        """What was said on these channels before, as far as it is of interest still."""
        said = [*self._feed.newest(channels)]
        if View.PATHS in channels:
            said += self._feed.paths()
        if View.LOG in channels:
            said += [(View.LOG, it) for it in self._events[: self._told]]
        return said

    def stop(self) -> None:
        """End it, and all connections."""
        self._server.stop()
