"""Says what has happened to robots and buses while it is news, each once."""

from collections.abc import Callable, Mapping


class Herald:
    """Look often enough.

    Args:
        look: what has happened so far, by whom it happened to.
        announce: told of each that is new, in words.
    """

    def __init__(
        self, look: Callable[[], Mapping[str, str]], announce: Callable[[str], None]
    ) -> None:
        self._look = look
        self._announce = announce
        self._said: set[str] = set()

    def look(self) -> None:
        """Say what is new."""
        for who, what in self._look().items():
            if who not in self._said:
                self._said.add(who)
                self._announce(f"{who}: {what}")
