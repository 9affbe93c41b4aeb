"""Output to the operator: results on standard output, progress and notes on standard error.

On a terminal a progress bar with the real-time factor moves, and under it a row per robot; what
happens is said above them. Elsewhere a plain line comes every few seconds, so that a CI log shows
life and nothing else.
"""

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Self

from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn
from rich.table import Table
from rich.text import Text

from bridge.process.clock import SYSTEM_CLOCK
from fleetloop.robot_rows import rows
from fleetloop.robot_states import RobotState
from fleetloop.streams import forget_output, is_utf8, spelled_for

PLAIN_EVERY_S = 5.0
LOOK_EVERY_S = 0.2
"""Shortest time between two pictures of a run."""
LINES_ABOVE = 6
"""Of a terminal, that the rows of robots leave for the bar and for what happens."""


def say(text: str) -> None:
    """Print a result; a closed reader is no failure."""
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        forget_output()


def say_json(value: object) -> None:
    """Print a result for programs: in UTF-8, or in ASCII where the stream has another encoding."""
    say(json.dumps(value, indent=2, ensure_ascii=not is_utf8(sys.stdout)))


class ResultConsole(Console):
    """Standard output for tables; a closed reader is no failure. `:X:` in a name is no emoji."""

    def __init__(self, **options: Any) -> None:
        super().__init__(emoji=False, **options)

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


class _Region(Progress):
    """Bars, and lines under them."""

    below: Callable[[], RenderableType | None] = staticmethod(lambda: None)

    def get_renderables(self) -> Iterable[RenderableType]:
        """All of it, as it is now."""
        yield self.make_tasks_table(self.tasks)
        if (lines := self.below()) is not None:
            yield lines


class Bars:
    """Bars on a terminal, elsewhere a line every few seconds; a context manager.

    What is said on standard error meanwhile comes above the bars.
    """

    def __init__(self, *columns: str | ProgressColumn, quiet: bool, bar_width: int = 24) -> None:
        self._console = console = Console(stderr=True, emoji=False)
        # A terminal that can't move its cursor is told lines, as a log is.
        self._moving = not quiet and console.is_terminal and not console.is_dumb_terminal
        self._plain = not quiet and not self._moving
        # Without a thread of its own: it is shown a few times a second anyway. Results on standard
        # output are no part of it.
        self._bars = _Region(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=bar_width),
            *columns,
            console=console,
            transient=True,
            auto_refresh=False,
            redirect_stdout=False,
            disable=not self._moving,
        )
        self._next_line_s = 0.0

    def __enter__(self) -> Self:
        self._bars.start()
        self._bars.refresh()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def notice(self, text: str) -> None:
        """Say what has just happened, above the bars."""
        if self._moving:
            self._console.print(text, style="yellow", markup=False, highlight=False, soft_wrap=True)
        else:
            note(text)

    def _refresh(self, line: Callable[[], str]) -> None:
        """Show the bars, or the line if one is due."""
        self._bars.refresh()
        if self._plain and (now_s := SYSTEM_CLOCK.monotonic_s()) >= self._next_line_s:
            self._next_line_s = now_s + PLAIN_EVERY_S
            note(line())


class RunProgress(Bars):
    """Shows how far a run is, and how its robots do.

    Args:
        name: of the scenario.
        duration_s: scenario time at which it ends.
        quiet: show nothing but notices.
    """

    def __init__(self, name: str, duration_s: float, *, quiet: bool = False) -> None:
        super().__init__(
            TextColumn("{task.completed:6.2f} / {task.total:g} s"),
            TextColumn("{task.fields[factor]}"),
            quiet=quiet,
        )
        self._name = name
        self._duration_s = duration_s
        self._task = self._bars.add_task(f"{name}: starting", total=duration_s, factor="")
        self._next_look_s = 0.0
        self.robots: Callable[[], Sequence[RobotState]] = lambda: ()
        """Asked for what is to be seen of the robots."""
        self._bars.below = self._rows

    def show(self, t_s: float, wall_s: float) -> None:
        """Say that scenario time `t_s` was reached after `wall_s` of running."""
        if (now_s := SYSTEM_CLOCK.monotonic_s()) < self._next_look_s:
            return
        self._next_look_s = now_s + LOOK_EVERY_S
        factor = f"{t_s / wall_s:5.1f} {self._spelled('×')} real time" if t_s > 0 < wall_s else ""
        self._bars.update(
            self._task, completed=max(t_s, 0.0), description=self._name, factor=factor
        )
        if t_s > 0 or self._moving:
            words = f"{self._name}: {t_s:.2f} / {self._duration_s:g} s  {factor.strip()}"
            self._refresh(lambda: words)

    def _spelled(self, text: str) -> str:
        return spelled_for(self._console.file, text)

    def _rows(self) -> RenderableType | None:
        width, height = self._console.size
        lines = rows(self.robots(), width, height - LINES_ABOVE, self._spelled)
        if not lines:
            return None
        whole = Text(no_wrap=True)
        for text, style in lines:
            whole.append(text + "\n", style)
        whole.right_crop(1)
        return whole
