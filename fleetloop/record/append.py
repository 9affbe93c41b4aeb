"""A file that only grows by whole pieces: what was appended is all there, or nothing of it is."""

import os
from pathlib import Path


class AppendedFile:
    """A new file of a recording; an OSError of any call leaves the pieces before it."""

    __slots__ = ("_fd", "size")

    def __init__(self, path: Path) -> None:
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
        self.size = 0

    def append(self, piece: bytes | bytearray) -> None:
        """Append a piece."""
        view = memoryview(piece)
        try:
            while view:
                view = view[os.write(self._fd, view) :]
        except OSError:
            os.ftruncate(self._fd, self.size)
            os.lseek(self._fd, self.size, os.SEEK_SET)
            raise
        self.size += len(piece)

    def rewrite_head(self, head: bytes) -> None:
        """Replace the first bytes."""
        os.pwrite(self._fd, head, 0)

    def close(self) -> None:
        """Close it. Idempotent."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
