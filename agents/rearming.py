"""Conditions for rearming after a stop.

    may_begin    no obstacle for `rearm_after`, and attempts are left
    timed_out    not armed within `rearm_limit` after the begin

Rearming repeats the whole sequence: disarm, torque 0, clear, arm, torque 0. An error that only a
person may clear (an e-stop above all) is an obstacle until another host clears it.
"""

from configs.brief import HostLimits


class Rearming:
    """Rearming of one robot: attempts left and times."""

    __slots__ = ("_attempts_left", "_began_ns", "_limits", "_well_since_ns")

    def __init__(self, limits: HostLimits, *, at_least: int = 0) -> None:
        self._limits = limits
        self._attempts_left = max(limits.rearm_attempts if limits.rearm else 0, at_least)
        self._well_since_ns: int | None = None
        self._began_ns = 0

    @property
    def exhausted(self) -> bool:
        """Whether no attempt is left: a stopped robot stays stopped."""
        return not self._attempts_left

    def may_begin(self, obstacle: str | None, now_ns: int) -> bool:
        """Whether to begin now; call once per period with the present obstacle."""
        if obstacle is not None:
            self._well_since_ns = None
            return False
        if self._well_since_ns is None:
            self._well_since_ns = now_ns
        if now_ns - self._well_since_ns < self._limits.rearm_after_ns:
            return False
        self._attempts_left -= 1
        self._well_since_ns = None
        self._began_ns = now_ns
        return True

    def timed_out(self, now_ns: int) -> bool:
        """Whether the attempt has exceeded `rearm_limit`."""
        return now_ns - self._began_ns > self._limits.rearm_limit_ns
