"""How far a tuning is: trials done, the best of them, time left."""

from bridge.process.clock import SYSTEM_CLOCK, Clock
from fleetloop.sweep.progress import Count
from fleetloop.tune.scores import Trial
from fleetloop.tune.tables import told


class Meter(Count):
    """One bar for all trials.

    Args:
        name: of the tuning.
        total: its trials.
        before: those that were done before.
        quiet: show nothing but notices.
    """

    def __init__(
        self, name: str, total: int, before: int, *, quiet: bool, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        super().__init__(name, total, before, unit="trials", quiet=quiet, clock=clock)
        self._best: Trial | None = None
        self._checking = False

    def advance(self, done: int, best: Trial | None) -> None:
        """So many trials are done, and this is the best of them."""
        self._done, self._best = done, best

    def check(self) -> None:
        """All trials are done; other cases come now."""
        self._checking = True

    def state(self) -> str:
        """The best so far, and the time left once there is a rate."""
        parts = [] if self._best is None else [f"best {told(self._best)}"]
        if self._checking:
            parts.append("judged on other cases now")
        elif (rate_1_s := self._rate_1_s()) is not None:
            parts.append(self._left(rate_1_s))
        return "".join(f", {part}" for part in parts)
