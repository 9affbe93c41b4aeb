"""Echoes: own frames that an interface hands back to their sender.

    sent        a frame goes out, and its echo is awaited for `ECHO_S`
    is_echo     an equal frame came: as often as it was sent, it is an echo

A neighbour's equal frame that comes first stands for the echo that comes later, so the count is
right whichever comes first.
"""

from bridge.frame import Frame
from configs.connections import Settings

ECHOING = frozenset({"udp_multicast"})
"""Interfaces that can't but hand back what is sent."""
ECHO_S = 1.0


def hands_back(settings: Settings) -> bool:
    """Whether a bus with these arguments of `can.Bus` hands back what is sent on it."""
    options = dict(settings)
    return options.get("interface") in ECHOING or bool(options.get("receive_own_messages"))


class Echoes:
    """Frames that were sent and have not come back; told the time, never asks for it."""

    __slots__ = ("_awaited",)

    def __init__(self) -> None:
        self._awaited: dict[Frame, tuple[float, int]] = {}  # sent last, how often; oldest first

    def sent(self, frame: Frame, now_s: float) -> None:
        """A frame goes out."""
        self._forget(now_s)
        _, count = self._awaited.pop(frame, (now_s, 0))
        self._awaited[frame] = now_s, count + 1

    def is_echo(self, frame: Frame, now_s: float) -> bool:
        """Whether a frame that came is one's own."""
        self._forget(now_s)
        awaited = self._awaited.get(frame)
        if awaited is None:
            return False
        sent_s, count = awaited
        if count > 1:
            self._awaited[frame] = sent_s, count - 1
        else:
            del self._awaited[frame]
        return True

    def _forget(self, now_s: float) -> None:
        awaited = self._awaited
        while awaited:
            oldest = next(iter(awaited))
            if now_s - awaited[oldest][0] <= ECHO_S:
                return
            del awaited[oldest]
