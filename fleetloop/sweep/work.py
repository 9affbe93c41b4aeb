"""What a worker does: the rows of some cases of a plan."""

import fcntl
import gc
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bridge.process.clock import SYSTEM_CLOCK
from fleetloop.sweep.batch import kernel_here, rows_of
from fleetloop.sweep.cases import cases_of
from fleetloop.sweep.dataset import Columns
from fleetloop.sweep.plan import Plan
from fleetloop.sweep.versions import Versions, mismatch, versions_here
from fleetloop.sweep.watch import Watch

if TYPE_CHECKING:
    import pyarrow as pa


class VersionMismatchError(Exception):
    """A worker isn't the program that the study was begun with."""


@dataclass(frozen=True, slots=True)
class Done:
    """What came of some cases."""

    rows: "pa.RecordBatch"
    began_s: float
    ended_s: float
    """By the worker's own monotonic clock."""
    process: int
    """Of the worker."""

    @property
    def busy_s(self) -> float:
        """Wall time of all of it."""
        return self.ended_s - self.began_s


def work(plan: Plan, numbers: tuple[int, ...], asked: Versions, *, kernel: bool) -> Done:
    """The rows of these cases.

    Args:
        plan: the study and its base.
        numbers: of the cases.
        asked: versions of the program that asks.
        kernel: whether the batch kernel is to be used for what it can do.

    Raises:
        VersionMismatchError: this one is another.
    """
    if differs := mismatch(asked, versions_here()):
        raise VersionMismatchError(differs)
    began_s = SYSTEM_CLOCK.monotonic_s()
    cases = cases_of(plan)
    engine = kernel_here() if kernel else None
    alone = _first_alone(compiles=engine is not None)
    with alone, _rare_collection(), Watch(cases.study.limit_s) as watch:
        rows = rows_of(cases, numbers, watch, engine)
    batch = Columns(cases).batch(rows)
    return Done(batch, began_s, SYSTEM_CLOCK.monotonic_s(), os.getpid())


@contextmanager
def _rare_collection() -> Iterator[None]:
    """Collect garbage rarely: what a run allocates is freed by its reference counts."""
    thresholds = gc.get_threshold()
    gc.set_threshold(50_000, 50, 100)
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


_compiled = False
"""Whether this process has run its first cases by the kernel."""


@contextmanager
def _first_alone(*, compiles: bool) -> Iterator[None]:
    """The first cases of a process, one process of a user and machine after the other.

    What the first one compiles for a minute, the others take from its cache.
    """
    global _compiled  # noqa: PLW0603
    opened = None
    if compiles and not _compiled:
        path = Path(tempfile.gettempdir(), f"fleetloop-kernel-{os.getuid()}.lock")
        with suppress(OSError):  # without it all of them compile
            opened = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
            fcntl.flock(opened, fcntl.LOCK_EX)
    try:
        yield
        _compiled |= compiles
    finally:
        if opened is not None:
            os.close(opened)
