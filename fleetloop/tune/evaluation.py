"""Who computes the cases of a trial: this process, or workers that share them.

Either brings the same rows, and a trial begins when the one before is done: how many workers there
are changes nothing but the time.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from bridge.process.lifecycle import Stop
from fleetloop.sweep.batch import kernel_here, rows_of
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.cluster import Place, client_of
from fleetloop.sweep.dataset import Columns
from fleetloop.sweep.engine import Engine
from fleetloop.sweep.watch import Watch

if TYPE_CHECKING:
    import pyarrow as pa


class Evaluation(Protocol):
    """Computes cases."""

    @property
    def workers(self) -> int:
        """Processes that shared them, at most at one time."""

    def __call__(self, cases: Cases, stop: Stop) -> "pa.Table | None":
        """The rows of all these cases, by number; None if told to stop."""


class Here:
    """Computes cases in this process, one after the other; a stop waits for the end of one."""

    def __init__(self, on_look: Callable[[], None] = lambda: None, *, kernel: bool = True) -> None:
        self._on_look = on_look
        self._kernel = kernel_here() if kernel else None

    @property
    def workers(self) -> int:
        """This process."""
        return 1

    def __call__(self, cases: Cases, stop: Stop) -> "pa.Table | None":
        """The rows of all these cases."""
        columns, batches = Columns(cases), []
        with Watch(cases.study.limit_s) as watch:
            for number in range(cases.study.total):
                if stop.requested:
                    return None
                batches.append(columns.batch(rows_of(cases, [number], watch, self._kernel)))
                self._on_look()
        return _table(batches)


class Workers:
    """Computes cases on the workers of a Dask client."""

    def __init__(
        self,
        client: Any,
        notice: Callable[[str], None],
        on_look: Callable[[], None],
        *,
        kernel: bool,
        scheduler: str | None,
    ) -> None:
        self._client, self._notice, self._on_look = client, notice, on_look
        self._kernel, self._scheduler = kernel, scheduler
        self._engine: Engine | None = None

    @property
    def workers(self) -> int:
        """Those of the client."""
        return 1 if self._engine is None else self._engine.most_threads

    def __call__(self, cases: Cases, stop: Stop) -> "pa.Table | None":
        """The rows of all these cases."""
        batches: list[Any] = []

        def take(batch: Any) -> bool:
            batches.append(batch)
            return False

        if self._engine is None:
            self._engine = Engine(
                self._client,
                cases,
                take,
                self._notice,
                kernel=self._kernel,
                scheduler=self._scheduler,
            )
        engine = self._engine
        engine.cases, engine.on_rows = cases, take
        total = cases.study.total
        engine.compute(range(total), total, stop, self._on_look)
        return None if stop.requested else _table(batches)


def is_here(place: Place) -> bool:
    """Whether this process alone computes all cases of a place."""
    return place.scheduler is None and place.workers == 1


@contextmanager
def evaluation_of(
    place: Place,
    folder: Path,
    notice: Callable[[str], None],
    on_look: Callable[[], None],
    *,
    kernel: bool,
) -> Iterator[Evaluation]:
    """Who computes cases at this place: one worker is this process.

    Raises:
        ScenarioError: Dask isn't there, or the address is none.
        InfrastructureError: the workers don't come.
    """
    if is_here(place):
        yield Here(on_look, kernel=kernel)
        return
    with client_of(place, folder) as client:
        yield Workers(client, notice, on_look, kernel=kernel, scheduler=place.scheduler)


def _table(batches: list[Any]) -> "pa.Table":
    import pyarrow as pa

    return pa.Table.from_batches(batches).sort_by("case")
