"""How far a study is: cases done, verdicts, rate, time left."""

from abc import abstractmethod
from collections import Counter
from collections.abc import Iterable

from rich.progress import TextColumn

from bridge.process.clock import SYSTEM_CLOCK, Clock
from fleetloop.terminal import Bars


class Count(Bars):
    """One bar for what is done one after the other.

    Args:
        name: of all of it.
        total: number of them.
        before: those that were done before.
        unit: what they are.
        quiet: show nothing but notices.
    """

    def __init__(
        self, name: str, total: int, before: int, *, unit: str, quiet: bool, clock: Clock
    ) -> None:
        amount = f"{{task.completed:.0f}} / {{task.total:.0f}} {unit}{{task.fields[state]}}"
        super().__init__(TextColumn(amount), quiet=quiet)
        self._name, self._total, self._before, self._unit = name, total, before, unit
        self._done = before
        self._clock = clock
        self._began_s = clock.monotonic_s()
        self._task = self._bars.add_task(name, total=total, state="")

    def begin(self) -> None:
        """The first one begins now."""
        self._began_s = self._clock.monotonic_s()

    def show(self) -> None:
        """Show how far it is."""
        state = self.state()
        self._bars.update(self._task, completed=self._done, state=state)
        self._refresh(lambda: self.line(state))

    def line(self, state: str) -> str:
        """The same as a line of a log."""
        return f"{self._name}: {self._done} of {self._total} {self._unit}{state}"

    @abstractmethod
    def state(self) -> str:
        """What is said behind the numbers."""

    def _rate_1_s(self) -> float | None:
        """Those that are done in a second; None before the first: workers load, or compile."""
        made = self._done - self._before
        passed_s = self._clock.monotonic_s() - self._began_s
        return made / passed_s if made and passed_s > 0 else None

    def _left(self, rate_1_s: float) -> str:
        """The time left."""
        left_s = round((self._total - self._done) / rate_1_s)
        return f"{left_s // 60}:{left_s % 60:02d} left"


class Meter(Count):
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
        super().__init__(name, total, before, unit="cases", quiet=quiet, clock=clock)
        self.counts: Counter[str] = Counter()

    def advance(self, verdicts: Iterable[str]) -> None:
        """Take note of cases that are done."""
        for verdict in verdicts:
            self._done += 1
            self.counts[verdict] += 1

    def line(self, state: str) -> str:
        """As a line of a log, with the verdicts."""
        counts = ", ".join(f"{n} {verdict}" for verdict, n in self.counts.items())
        told = super().line(state)
        return f"{told}: {counts}" if counts else told

    def state(self) -> str:
        """Rate and time left, once there is a rate."""
        rate_1_s = self._rate_1_s()
        if rate_1_s is None:
            return ", starting"
        told = f"{rate_1_s:.0f} a second" if rate_1_s >= 10 else f"{60 * rate_1_s:.0f} a minute"
        return f", {told}, {self._left(rate_1_s)}"
