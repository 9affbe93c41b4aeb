"""What an axis says of itself, and when: periods in whole milliseconds, 0 for never.

A message is due at multiples of its period, so nothing drifts, whatever was late.
"""

from collections.abc import Sequence

from bridge.drives.odrive.frames import Command

NEVER = 1 << 62
CYCLIC = (
    Command.HEARTBEAT,
    Command.GET_ERROR,
    Command.GET_IQ,
    Command.GET_TEMPERATURE,
    Command.GET_BUS_VOLTAGE_CURRENT,
    Command.GET_TORQUES,
    Command.GET_POWERS,
)
"""In order of arbitration; the encoder's frame has its own place in the hot path."""


class Cyclic:
    """Due times of all cyclic messages but the encoder's."""

    __slots__ = ("_next_ns", "next_ns", "periods_ns")

    def __init__(self, periods_ns: dict[Command, int]) -> None:
        self.periods_ns = dict(periods_ns)
        self._next_ns = dict.fromkeys(CYCLIC, 0)
        self.next_ns = 0
        """When the first of them is due."""

    def set_period(self, command: Command, period_ns: int, now_ns: int) -> None:
        """Change a rate."""
        self.periods_ns[command] = period_ns
        self._next_ns[command] = after(now_ns, period_ns)
        self._note()

    def restart(self, now_ns: int) -> None:
        """All are due now."""
        self._next_ns = dict.fromkeys(CYCLIC, now_ns)
        self.next_ns = now_ns

    def take(self, now_ns: int) -> Sequence[Command]:
        """What is due now."""
        due = []
        for command in CYCLIC:
            period_ns = self.periods_ns.get(command, 0)
            if period_ns and now_ns >= self._next_ns[command]:
                self._next_ns[command] = after(now_ns, period_ns)
                due.append(command)
        self._note()
        return due

    def _note(self) -> None:
        periods = self.periods_ns
        self.next_ns = min((self._next_ns[c] for c in CYCLIC if periods.get(c, 0)), default=NEVER)


def after(now_ns: int, period_ns: int) -> int:
    """The next multiple of the period after now; never for period 0."""
    return (now_ns // period_ns + 1) * period_ns if period_ns else NEVER
