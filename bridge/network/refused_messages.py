"""Counts of refused messages, by sender and kind.

A message is refused because it can't be decoded (`bridge.network.messages`), because its content is
impossible, or because its buffer is full. No reader fails for the content of a message: refusals
are counted here, and the counts go with the reader's report into the summary.
"""

from collections import Counter
from typing import NamedTuple

FLOOD = 1000
"""More refused messages of one sender than a mistake explains."""
MOST_KINDS = 32
"""Of senders and kinds that are told apart; what comes later counts as others."""


class _Kind(NamedTuple):
    what: str
    sender: str
    kind: str


class Refusals:
    """Counts of one reader."""

    __slots__ = ("_counts", "_details")

    def __init__(self) -> None:
        self._counts: dict[_Kind, int] = {}
        self._details: dict[_Kind, str] = {}

    def note(self, what: str, sender: str, kind: str, detail: str = "", count: int = 1) -> None:
        """Count messages: `what` they were to be, and why they were refused.

        Args:
            what: in the singular, such as "path state".
            sender: whose key it came on.
            kind: what was wrong, told apart in counts.
            detail: what was wrong with the first of its kind, for people; `kind` if not given.
            count: how many.
        """
        if count <= 0:
            return
        key = _Kind(what, sender, kind)
        if key not in self._counts and len(self._counts) >= MOST_KINDS:
            key = _Kind("message", "others", "too many kinds to tell apart")
        self._details.setdefault(key, detail or key.kind)
        self._counts[key] = self._counts.get(key, 0) + count

    def floods(self) -> list[str]:
        """Senders of so many refused messages that their reader had no time for others."""
        counts: Counter[str] = Counter()
        for key, count in self._counts.items():
            counts[key.sender] += count
        return [f"{sender} ({n} messages)" for sender, n in counts.items() if n >= FLOOD]

    def lines(self) -> list[str]:
        """Each kind in words: "refused 3 path states of r1: dated 3600 s ahead"."""
        return [
            f"refused {count} {what}{'s' if count > 1 else ''} of {sender}:"
            f" {self._details[_Kind(what, sender, kind)]}"
            for (what, sender, kind), count in self._counts.items()
        ]
