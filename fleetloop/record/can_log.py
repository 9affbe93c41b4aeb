"""Recordings of a CAN bus that stock tools replay: Vector BLF and candump log.

Both take blocks of frames as they come from the plant, each record 24 bytes, little endian:

    stamp_ns i64   can_id u32   length u8   flags u8   2 bytes padding   data 8 bytes

    stamp_ns   bus time [ns]; before power-up it counts as 0
    can_id     as SocketCAN's, with the flag bits EFF, RTR and ERR of `bridge.frame`
    length     bytes of data, 0..8; for a remote frame, which it asks for
    flags      bit 0: from a drive, so received (Rx) as the host sees it; else sent by a host (Tx)

A block is converted as a whole in numpy: a frame costs a fraction of a microsecond, where a writer
of messages costs five. What was flushed is readable whatever happens to the process afterwards.
Times in the files are bus time, so that the same run leaves the same bytes on any day.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt

from configs.errors import InfrastructureError
from fleetloop.record.blf import BlfFile
from fleetloop.record.candump_log import CandumpLog

FRAME = np.dtype(
    [
        ("stamp_ns", "<i8"),
        ("can_id", "<u4"),
        ("length", "u1"),
        ("flags", "u1"),
        ("padding", "V2"),
        ("data", "u1", (8,)),
    ]
)
FROM_DRIVE = 1
Frames = npt.NDArray[np.void]


def frames_of(block: bytes | memoryview | Frames) -> Frames:
    """The frames in a block.

    Raises:
        ValueError: its size is no multiple of a record's, or an array has another type.
    """
    if isinstance(block, np.ndarray):
        if block.dtype != FRAME:
            raise ValueError(f"a block of frames has the type {FRAME}, not {block.dtype}")
        return block
    if len(block) % FRAME.itemsize:
        raise ValueError(f"a block of frames is n times {FRAME.itemsize} bytes, not {len(block)}")
    return np.frombuffer(block, FRAME)


class CanLogWriter:
    """Writes one bus into a BLF file, a candump log, or both; a context manager.

    Args:
        blf_path: the BLF file, None for none.
        log_path: the candump log, None for none.
        channel: the bus's number in the BLF file, from 1; python-can's reader counts from 0.
        name: the bus's name in the candump log.

    Raises:
        InfrastructureError: a file can't be written; so do `write`, `flush` and `close`.
    """

    def __init__(
        self, blf_path: Path | None, log_path: Path | None, *, channel: int, name: str
    ) -> None:
        self._writers: list[tuple[Path, BlfFile | CandumpLog]] = []
        try:
            if blf_path is not None:
                with _named(blf_path):
                    self._writers.append((blf_path, BlfFile(blf_path, channel)))
            if log_path is not None:
                with _named(log_path):
                    self._writers.append((log_path, CandumpLog(log_path, name)))
        except InfrastructureError:
            self.discard()
            raise

    def write(self, block: bytes | memoryview | Frames) -> None:
        """Append a block of frames; in the file at once, or with the next flush."""
        frames = frames_of(block)
        if len(frames):
            for path, writer in self._writers:
                with _named(path):
                    writer.write(frames)

    def flush(self) -> None:
        """Put everything so far into the files; both are complete until the next write."""
        for path, writer in self._writers:
            with _named(path):
                writer.flush()

    def close(self) -> None:
        """Flush and close. Idempotent."""
        with contextlib.ExitStack() as all_of_them:
            for path, writer in self._writers:
                all_of_them.enter_context(_named(path))
                all_of_them.callback(writer.close)

    def discard(self) -> None:
        """Close and remove the files: nothing is in them."""
        for _, writer in self._writers:
            writer.discard()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InfrastructureError(f"can't write {path}: {error.strerror or error}") from error
