"""How far a tuning is: trials done, the best of them, time left."""

from rich.progress import TextColumn

from bridge.process.clock import SYSTEM_CLOCK, Clock
from fleetloop.terminal import Bars
from fleetloop.tune.scores import Trial
from fleetloop.tune.tables import told


class Meter(Bars):
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
        amount = "{task.completed:.0f} / {task.total:.0f} trials{task.fields[state]}"
        super().__init__(TextColumn(amount), quiet=quiet)
        self._name, self._total, self._before, self._done = name, total, before, before
        self._clock = clock
        self._began_s = clock.monotonic_s()
        self._best: Trial | None = None
        self._checking = False
        self._task = self._bars.add_task(name, total=total, state="")

    def begin(self) -> None:
        """The first trial begins now."""
        self._began_s = self._clock.monotonic_s()

    def advance(self, done: int, best: Trial | None) -> None:
        """So many trials are done, and this is the best of them."""
        self._done, self._best = done, best

    def check(self) -> None:
        """All trials are done; other cases come now."""
        self._checking = True

    def show(self) -> None:
        """Show how far it is."""
        state = self.state()
        self._bars.update(self._task, completed=self._done, state=state)
        self._refresh(lambda: f"{self._name}: {self._done} of {self._total} trials{state}")

    def state(self) -> str:
        """The best so far, and the time left once there is a rate."""
        best, made = self._best, self._done - self._before
        parts = [] if best is None else [f"best {told(best)}"]
        passed_s = self._clock.monotonic_s() - self._began_s
        if self._checking:
            parts.append("judged on other cases now")
        elif made and passed_s > 0:
            left_s = round((self._total - self._done) * passed_s / made)
            parts.append(f"{left_s // 60}:{left_s % 60:02d} left")
        return "".join(f", {part}" for part in parts)
