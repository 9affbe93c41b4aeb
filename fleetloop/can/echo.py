"""Distinguishes frames that a gateway's far bus hands back from frames of other nodes there.

Echoes of an interface that hands back what is sent are told by `bridge.can_bus.echo`, and dropped.

A second gateway between the same two buses would send every frame round for ever. It shows in that
almost all that comes had been sent before, at most `MEMORY_S` ago: `SHARE` of at least `LEAST`
frames within a second.
"""

from collections import deque

from bridge.can_bus.echo import Echoes
from bridge.frame import Frame

MEMORY_S = 10.0
WINDOW_S = 1.0
LEAST = 200
SHARE = 0.8


class EchoGuard:
    """Memory of the frames sent to one bus; the time is an argument."""

    __slots__ = ("_came", "_echoes", "_familiar", "_order", "_sent", "_window_s", "storm")

    def __init__(self, *, echoes: bool) -> None:
        self.storm = False
        self._echoes = Echoes() if echoes else None
        self._sent: dict[Frame, int] = {}  # how often within `MEMORY_S`
        self._order: deque[tuple[float, Frame]] = deque()
        self._window_s = float("-inf")
        self._came = 0
        self._familiar = 0

    def sent(self, frame: Frame, now_s: float) -> None:
        """A frame goes out."""
        self._forget(now_s)
        self._sent[frame] = self._sent.get(frame, 0) + 1
        if self._echoes is not None:
            self._echoes.sent(frame, now_s)
        self._order.append((now_s, frame))

    def is_echo(self, frame: Frame, now_s: float) -> bool:
        """Whether a frame that came is one's own, and not to be passed on."""
        self._forget(now_s)
        if self._echoes is not None and self._echoes.is_echo(frame, now_s):
            return True
        self._watch(now_s, familiar=frame in self._sent)
        return False

    def _watch(self, now_s: float, *, familiar: bool) -> None:
        if now_s - self._window_s >= WINDOW_S:
            self._window_s, self._came, self._familiar = now_s, 0, 0
        self._came += 1
        self._familiar += familiar
        if self._came >= LEAST and self._familiar >= SHARE * self._came:
            self.storm = True

    def _forget(self, now_s: float) -> None:
        order = self._order
        while order and now_s - order[0][0] > MEMORY_S:
            _, frame = order.popleft()
            self._sent[frame] -= 1
            if not self._sent[frame]:
                del self._sent[frame]
