"""How far the runs of a comparison are."""

from collections.abc import Mapping, Sequence
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from bridge.network.messages import Progress as RunProgress
from bridge.process.clock import SYSTEM_CLOCK
from fleetloop.terminal import PLAIN_EVERY_S, note


class Bars:
    """A bar per run on a terminal, elsewhere a line every few seconds; a context manager."""

    def __init__(self, labels: Sequence[str], ends_s: float, *, quiet: bool) -> None:
        self._labels, self._ends_s, self._quiet = labels, ends_s, quiet
        console = Console(stderr=True)
        # Without a thread of its own: it is shown a few times a second anyway.
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.completed:6.2f} / {task.total:g} s"),
            console=console,
            transient=True,
            auto_refresh=False,
            disable=quiet or not console.is_terminal,
        )
        self._plain = not quiet and not console.is_terminal
        self._next_line_s = 0.0

    def __enter__(self) -> Self:
        self._bars.start()
        self._tasks = [self._bars.add_task(label, total=self._ends_s) for label in self._labels]
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def show(self, far: Mapping[int, RunProgress], done: Mapping[int, object]) -> None:
        """Show how far each run is."""
        for number, task in enumerate(self._tasks):
            reached_s = max(far[number].t_ns * 1e-9, 0.0) if number in far else 0.0
            self._bars.update(task, completed=self._ends_s if number in done else reached_s)
        self._bars.refresh()
        if self._plain and SYSTEM_CLOCK.monotonic_s() >= self._next_line_s:
            self._next_line_s = SYSTEM_CLOCK.monotonic_s() + PLAIN_EVERY_S
            running = [
                f"{self._labels[n]} {state.t_ns * 1e-9:.1f} s"
                for n, state in far.items()
                if n not in done
            ]
            told = f"{len(done)} of {len(self._labels)} runs done"
            note("; ".join([told, *([", ".join(running)] if running else [])]))
