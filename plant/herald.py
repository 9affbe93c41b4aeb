"""The plant's events: kept in their order, and each announced once."""

from collections.abc import Callable, Mapping

from configs.events import Event, EventLog


class Herald:
    """Keeps and announces the events of a plant; the first `MAX_EVENTS` of them.

    Args:
        look: all events so far of those that are looked for, each under a name of its own; asked
            with the present tick.
        announce: called with each new event.
    """

    def __init__(
        self, look: Callable[[int], Mapping[str, Event]], announce: Callable[[Event], None]
    ) -> None:
        self._look = look
        self._announce = announce
        self._seen: set[str] = set()
        self._log = EventLog()
        self.events = self._log.kept
        self.remarks = self._log.remarks

    def look(self, tick: int) -> None:
        """Note each event that is new."""
        for name, event in self._look(tick).items():
            if name not in self._seen:
                self._seen.add(name)
                self.note(event)

    def note(self, event: Event) -> None:
        """Keep and announce an event that has just happened."""
        if self._log.take(event):
            self._announce(event)
