"""When a robot that stopped itself may arm again.

    may_begin    nothing stood in the way for `rearm_after`, and attempts are left
    late         not armed within `rearm_limit` after that

Arming again is the whole way of the first time: disarm, torque 0, clear, arm, torque 0. What a
person has to clear (an e-stop above all) stands in the way until it is cleared by somebody else.
"""

from configs.brief import HostLimits


class Rearming:
    """Counts the attempts of one run."""

    __slots__ = ("_attempts_left", "_began_ns", "_limits", "_well_since_ns")

    def __init__(self, limits: HostLimits) -> None:
        self._limits = limits
        self._attempts_left = limits.rearm_attempts if limits.rearm else 0
        self._well_since_ns: int | None = None
        self._began_ns = 0

    @property
    def exhausted(self) -> bool:
        """Whether a stopped robot stays stopped whatever happens."""
        return not self._attempts_left

    def may_begin(self, obstacle: str | None, now_ns: int) -> bool:
        """Whether to begin now, told once per period what stands in the way."""
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
        """Whether closed loop should have been there by now."""
        return now_ns - self._began_ns > self._limits.rearm_limit_ns
