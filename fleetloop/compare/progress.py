"""How far the runs of a comparison are."""

from collections.abc import Mapping, Sequence

from rich.progress import TextColumn

from bridge.network.messages import Progress
from fleetloop.terminal import Bars


class RunBars(Bars):
    """A bar per run."""

    def __init__(self, labels: Sequence[str], ends_s: float, *, quiet: bool) -> None:
        super().__init__(TextColumn("{task.completed:6.2f} / {task.total:g} s"), quiet=quiet)
        self._labels, self._ends_s = labels, ends_s
        self._tasks = [self._bars.add_task(label, total=ends_s) for label in labels]

    def show(self, far: Mapping[int, Progress], done: Mapping[int, object]) -> None:
        """Show how far each run is."""
        for number, task in enumerate(self._tasks):
            reached_s = max(far[number].t_ns * 1e-9, 0.0) if number in far else 0.0
            self._bars.update(task, completed=self._ends_s if number in done else reached_s)
        self._refresh(lambda: self._line(far, done))

    def _line(self, far: Mapping[int, Progress], done: Mapping[int, object]) -> str:
        running = ", ".join(
            f"{self._labels[n]} {state.t_ns * 1e-9:.1f} s"
            for n, state in far.items()
            if n not in done
        )
        told = f"{len(done)} of {len(self._labels)} runs done"
        return f"{told}; {running}" if running else told
