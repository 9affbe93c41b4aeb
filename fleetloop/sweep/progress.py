"""How far a study is: cases done, verdicts, rate, time left."""

from collections import Counter
from collections.abc import Iterable

from rich.progress import TextColumn

from bridge.process.clock import SYSTEM_CLOCK, Clock
from fleetloop.terminal import Bars


class Meter(Bars):
    """One bar for all cases.

    Args:
        name: of the study.
        total: its cases.
        before: those that were done before.
        quiet: show nothing but notices.
    """

    def __init__(
        self, name: str, total: int, before: int, *, quiet: bool, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        amount = "{task.completed:.0f} / {task.total:.0f} cases{task.fields[pace]}"
        super().__init__(TextColumn(amount), quiet=quiet)
        self._name, self._total, self._before = name, total, before
        self._done = before
        self._clock = clock
        self.counts: Counter[str] = Counter()
        self._began_s = clock.monotonic_s()
        self._task = self._bars.add_task(name, total=total, pace="")

    def begin(self) -> None:
        """The first case begins now."""
        self._began_s = self._clock.monotonic_s()

    def advance(self, verdicts: Iterable[str]) -> None:
        """Take note of cases that are done."""
        for verdict in verdicts:
            self._done += 1
            self.counts[verdict] += 1

    def show(self) -> None:
        """Show how far it is."""
        pace = self.pace()
        self._bars.update(self._task, completed=self._done, pace=pace)
        self._refresh(lambda: self.line(pace))

    def line(self, pace: str) -> str:
        """The same as a line of a log."""
        counts = ", ".join(f"{n} {verdict}" for verdict, n in self.counts.items())
        told = f"{self._name}: {self._done} of {self._total} cases{pace}"
        return f"{told}: {counts}" if counts else told

    def pace(self) -> str:
        """Rate and time left, once there is a rate: workers load, or compile, first."""
        made = self._done - self._before
        passed_s = self._clock.monotonic_s() - self._began_s
        if not made or passed_s <= 0:
            return ", starting"
        rate = made / passed_s
        told = f"{rate:.0f} a second" if rate >= 10 else f"{60 * rate:.0f} a minute"
        left_s = round((self._total - self._done) / rate)
        return f", {told}, {left_s // 60}:{left_s % 60:02d} left"
