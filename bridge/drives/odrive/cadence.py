"""Detection of a second sender of one identifier, by the rate of its frames.

    ratio = frames in a window / frames that one sender sends in it

CAN has no sender's address: a second drive with the same node id, or another node that uses it,
shows in the ratio alone, which is near 2. Windows are a second or longer, so what a machine that
stood still for a fifth of it delivers at once stays below `LIMIT`.
"""

from typing import Final

WINDOW_NS: Final = 1_000_000_000
WINDOW_PERIODS: Final = 10
LIMIT: Final = 1.5


class Cadence:
    """Judges one cyclic identifier, a window at a time."""

    __slots__ = ("_count", "_from_ns", "_period_ns", "_window_ns")

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._window_ns = max(WINDOW_NS, WINDOW_PERIODS * period_ns)
        self._from_ns: int | None = None
        self._count = 0

    def judge(self, count: int, now_ns: int) -> float | None:
        """The ratio of a window that ends now, None while it lasts; `count` is that of all time."""
        if self._from_ns is None or now_ns < self._from_ns:
            self._from_ns, self._count = now_ns, count
            return None
        elapsed_ns = now_ns - self._from_ns
        if elapsed_ns < self._window_ns:
            return None
        ratio = (count - self._count) * self._period_ns / elapsed_ns
        self._from_ns, self._count = now_ns, count
        return ratio
