"""Tells what a gateway's far bus hands back from what others say there.

Some interfaces (udp_multicast) return a node's own frames as received ones. For each frame sent,
one equal frame that comes within `ECHO_S` is dropped; a neighbour's equal frame then stands for
the echo that comes later, so the count is right whichever comes first.

A second gateway between the same two buses would send every frame round for ever. It shows in that
almost all that comes had been sent before, at most `MEMORY_S` ago: `SHARE` of at least `LEAST`
frames within a second.
"""

from collections import deque

from bridge.frame import Frame

ECHO_S = 1.0
MEMORY_S = 10.0
WINDOW_S = 1.0
LEAST = 200
SHARE = 0.8


class _Sent:
    __slots__ = ("last_s", "remembered", "unreturned")

    def __init__(self) -> None:
        self.last_s = float("-inf")
        self.remembered = 0
        self.unreturned = 0


class EchoGuard:
    """Remembers what was sent to one bus; told the time, never asks for it."""

    __slots__ = ("_came", "_echoes", "_familiar", "_order", "_sent", "_window_s", "storm")

    def __init__(self, *, echoes: bool) -> None:
        self.storm = False
        self._echoes = echoes
        self._sent: dict[Frame, _Sent] = {}
        self._order: deque[tuple[float, Frame]] = deque()
        self._window_s = float("-inf")
        self._came = 0
        self._familiar = 0

    def sent(self, frame: Frame, now_s: float) -> None:
        """A frame goes out."""
        self._forget(now_s)
        entry = self._sent.get(frame)
        if entry is None:
            entry = self._sent[frame] = _Sent()
        if now_s - entry.last_s > ECHO_S:
            entry.unreturned = 0
        entry.last_s = now_s
        entry.remembered += 1
        entry.unreturned += 1
        self._order.append((now_s, frame))

    def is_echo(self, frame: Frame, now_s: float) -> bool:
        """Whether a frame that came is one's own, and not to be passed on."""
        self._forget(now_s)
        entry = self._sent.get(frame)
        recent = entry is not None and now_s - entry.last_s <= ECHO_S
        if self._echoes and entry is not None and recent and entry.unreturned:
            entry.unreturned -= 1
            return True
        self._watch(now_s, familiar=entry is not None)
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
            entry = self._sent[frame]
            entry.remembered -= 1
            if not entry.remembered:
                del self._sent[frame]
