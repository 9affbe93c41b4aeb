"""Announcement of events of robots and buses, each once."""

from collections.abc import Callable, Mapping


class Herald:
    """Announces new entries of a table of events, whenever `look` is called.

    Args:
        look: all events so far, in words, by robot or bus.
        announce: called with each new one.
    """

    def __init__(
        self, look: Callable[[], Mapping[str, str]], announce: Callable[[str], None]
    ) -> None:
        self._look = look
        self._announce = announce
        self._announced: set[str] = set()

    def look(self) -> None:
        """Announce what is new."""
        for name, event in self._look().items():
            if name not in self._announced:
                self._announced.add(name)
                self._announce(f"{name}: {event}")
