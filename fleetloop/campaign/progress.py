"""How far a campaign is: cells done, rate, time left."""

from collections import Counter
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from bridge.process.clock import SYSTEM_CLOCK
from fleetloop.campaign.branches import Baseline
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.terminal import PLAIN_EVERY_S, note


class Meter:
    """A bar on a terminal, elsewhere a line every few seconds; a context manager."""

    def __init__(self, name: str, total: int, before: int, *, quiet: bool) -> None:
        self._name, self._total, self._before, self._quiet = name, total, before, quiet
        self._done = before
        self._counts: Counter[Verdict] = Counter()
        self._began_s = SYSTEM_CLOCK.monotonic_s()
        self._next_line_s = 0.0
        console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.completed:.0f} / {task.total:.0f} cells{task.fields[pace]}"),
            console=console,
            transient=True,
            auto_refresh=False,
            disable=quiet or not console.is_terminal,
        )
        self._plain = not quiet and not console.is_terminal

    def __enter__(self) -> Self:
        self._bar.start()
        self._task = self._bar.add_task(self._name, total=self._total, pace="")
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

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
        self._bar.update(self._task, completed=self._done, pace=pace)
        self._bar.refresh()
        now_s = SYSTEM_CLOCK.monotonic_s()
        if self._plain and now_s >= self._next_line_s:
            self._next_line_s = now_s + PLAIN_EVERY_S
            counts = ", ".join(f"{n} {verdict}" for verdict, n in self._counts.items())
            told = f"{self._name}: {self._done} of {self._total} cells{pace}"
            note(f"{told}: {counts}" if counts else told)

    def _pace(self) -> str:
        """Rate and time left, once there is a rate."""
        made = self._done - self._before
        passed_s = SYSTEM_CLOCK.monotonic_s() - self._began_s
        if not made or passed_s <= 0:
            return ""
        left_s = round((self._total - self._done) * passed_s / made)
        return f", {60 * made / passed_s:.0f} a minute, {left_s // 60}:{left_s % 60:02d} left"
