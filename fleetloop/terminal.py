"""Output to the operator: results on standard output, progress and notes on standard error.

On a terminal a progress bar with the real-time factor moves; elsewhere a plain line comes every few
seconds, so that a CI log shows life and nothing else.
"""

import json
import sys
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.measure import Measurement
from rich.progress import BarColumn, Progress, TaskID, TextColumn
from rich.table import Table
from rich.text import Text

from bridge.process.clock import SYSTEM_CLOCK
from fleetloop.streams import forget_output, spelled_for

PLAIN_EVERY_S = 5.0


def say(text: str) -> None:
    """Print a result; a closed reader is no failure."""
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        forget_output()


def say_json(value: object) -> None:
    """Print a result for programs: in UTF-8, or in ASCII where the stream has another encoding."""
    unicode = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"
    say(json.dumps(value, indent=2, ensure_ascii=not unicode))


class ResultConsole(Console):
    """Standard output for tables; a closed reader is no failure."""

    def render_str(self, text: str, **options: Any) -> Text:
        """As the stream will show it."""
        return super().render_str(spelled_for(self.file, text), **options)

    def print_whole(self, table: Table) -> None:
        """Print a table that loses nothing, however narrow the terminal is."""
        needed = Measurement.get(self, self.options.update(width=sys.maxsize), table).maximum
        self.width = max(self.width, needed)
        self.print(table)

    def on_broken_pipe(self) -> None:
        """Go on in silence."""
        self.quiet = True
        forget_output()


def note(text: str) -> None:
    """Print a note that is not part of the result."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


class Bars:
    """Bars on a terminal, elsewhere a line every few seconds; a context manager."""

    def __init__(self, amount: str, *, quiet: bool) -> None:
        console = Console(stderr=True)
        # Without a thread of its own: it is shown a few times a second anyway.
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn(amount),
            console=console,
            transient=True,
            auto_refresh=False,
            disable=quiet or not console.is_terminal,
        )
        self._plain = not quiet and not console.is_terminal
        self._next_line_s = 0.0

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def _refresh(self, line: Callable[[], str]) -> None:
        """Show the bars, or the line if one is due."""
        self._bars.refresh()
        if self._plain and (now_s := SYSTEM_CLOCK.monotonic_s()) >= self._next_line_s:
            self._next_line_s = now_s + PLAIN_EVERY_S
            note(line())


class RunProgress:
    """Shows how far a run is; a context manager."""

    def __init__(self, name: str, duration_s: float, *, quiet: bool = False) -> None:
        self._name = name
        self._duration_s = duration_s
        self._quiet = quiet
        self._console = Console(stderr=True)
        self._bar: Progress | None = None
        self._task = TaskID(0)
        self._next_line = 0.0

    def __enter__(self) -> Self:
        if self._console.is_terminal and not self._quiet:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.completed:6.2f} / {task.total:g} s"),
                TextColumn("{task.fields[factor]}"),
                console=self._console,
                transient=True,
            )
            self._bar.start()
            self._task = self._bar.add_task(
                f"{self._name}: starting", total=self._duration_s, factor=""
            )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def notice(self, text: str) -> None:
        """Say what has just happened, above the bar."""
        if self._bar is not None:
            self._console.print(text, style="yellow", markup=False, highlight=False, soft_wrap=True)
        else:
            note(text)

    def show(self, t_s: float, wall_s: float) -> None:
        """Say that scenario time `t_s` was reached after `wall_s` of running."""
        factor = f"{t_s / wall_s:5.1f} × real time" if t_s > 0 and wall_s > 0 else ""
        if self._bar is not None:
            self._bar.update(
                self._task, completed=max(t_s, 0.0), description=self._name, factor=factor
            )
        elif not self._quiet and t_s > 0 and (now := SYSTEM_CLOCK.monotonic_s()) >= self._next_line:
            self._next_line = now + PLAIN_EVERY_S
            note(f"{self._name}: {t_s:.2f} / {self._duration_s:g} s  {factor.strip()}")
