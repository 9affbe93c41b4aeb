"""How far a campaign is: cells done, rate, time left."""

from collections import Counter

from rich.progress import TextColumn

from bridge.process.clock import SYSTEM_CLOCK
from fleetloop.campaign.branches import Baseline
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.terminal import Bars, note


class Meter(Bars):
    """One bar for all cells."""

    def __init__(self, name: str, total: int, before: int, *, quiet: bool) -> None:
        amount = "{task.completed:.0f} / {task.total:.0f} cells{task.fields[pace]}"
        super().__init__(TextColumn(amount), quiet=quiet)
        self._name, self._total, self._before, self._quiet = name, total, before, quiet
        self._done = before
        self._counts: Counter[Verdict] = Counter()
        self._began_s = SYSTEM_CLOCK.monotonic_s()
        self._task = self._bars.add_task(name, total=total, pace="")

    def advance(self, said: Baseline | Result) -> None:
        """Take note of what came."""
        if isinstance(said, Result):
            self._done += 1
            self._counts[said.verdict] += 1
        elif said.verdict != "held" and not self._quiet:
            note(f"{self._name}: without a fault, seed {said.seed}: {said.verdict}: {said.reason}")

    def show(self) -> None:
        """Show how far it is."""
        pace = self._pace()
        self._bars.update(self._task, completed=self._done, pace=pace)
        self._refresh(lambda: self._line(pace))

    def _line(self, pace: str) -> str:
        counts = ", ".join(f"{n} {verdict}" for verdict, n in self._counts.items())
        told = f"{self._name}: {self._done} of {self._total} cells{pace}"
        return f"{told}: {counts}" if counts else told

    def _pace(self) -> str:
        """Rate and time left, once there is a rate."""
        made = self._done - self._before
        passed_s = SYSTEM_CLOCK.monotonic_s() - self._began_s
        if not made or passed_s <= 0:
            return ""
        left_s = round((self._total - self._done) * passed_s / made)
        return f", {60 * made / passed_s:.0f} a minute, {left_s // 60}:{left_s % 60:02d} left"
