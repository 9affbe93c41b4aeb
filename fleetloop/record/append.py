"""A file that grows by whole pieces: each is in it as a whole or not at all.

A piece is appended for good, or put at the end as the tail: readable at once, and replaced by what
is appended or put next. So what is written doesn't depend on when it was flushed.

Space for what has to be written at the end of all can be reserved beforehand, so that a file can be
completed on a disk that has become full.
"""

import contextlib
import ctypes
import errno
import os
import stat
from pathlib import Path

_KEEP_SIZE = 1
_STEP = 4 * 1024 * 1024
"""Space is reserved in steps of so many bytes, so that most pieces need no call for it."""
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class AppendedFile:
    """A new file of a recording, or one that goes on; an OSError leaves the pieces before it."""

    __slots__ = ("_fd", "_path", "_reserved", "_tail", "size")

    def __init__(self, path: Path, *, goes_on: bool = False) -> None:
        how = os.O_WRONLY if goes_on else os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        self._path = path
        self._fd = os.open(path, how | os.O_CLOEXEC, 0o666)
        self.size = 0
        """Without the tail."""
        self._tail = b""
        self._reserved = 0
        if goes_on:
            self.size = os.lseek(self._fd, 0, os.SEEK_END)

    def append(self, piece: bytes | bytearray) -> None:
        """Append a piece, in place of the tail."""
        self._put(piece)
        self._tail = b""
        self.size += len(piece)

    def put_tail(self, piece: bytes) -> None:
        """Put a piece at the end, in place of the tail."""
        self._put(piece)
        self._tail = piece

    def take_tail(self, path: Path, size: int) -> None:
        """Take what is in the file beyond a size for the tail."""
        with path.open("rb") as stream:
            stream.seek(size)
            self._tail = stream.read()
        self.size = size

    def reserve(self, length: int) -> None:
        """Make sure that so many bytes more can be written, whatever becomes of the disk.

        Where the file system can't promise it, nothing happens.
        """
        needed = self.size + length
        if needed <= self._reserved:
            return
        try:
            try:
                self._allocate(needed + _STEP)
            except OSError as error:
                if error.errno not in _NO_SPACE:
                    raise
                self._allocate(needed)
        except OSError as error:
            if error.errno in _NO_SPACE:
                raise

    def cut(self, size: int) -> None:
        """Drop everything beyond a size, the tail, and what was reserved."""
        os.ftruncate(self._fd, size)
        os.lseek(self._fd, size, os.SEEK_SET)
        self.size = size
        self._tail = b""
        self._reserved = 0

    def rewrite_head(self, head: bytes) -> None:
        """Replace the first bytes."""
        os.pwrite(self._fd, head, 0)

    def in_place(self) -> bool:
        """Whether its path still leads to it: neither it nor its folder was removed or moved."""
        try:
            return os.path.samestat(self._path.stat(), os.fstat(self._fd))
        except FileNotFoundError:
            return False

    def close(self) -> None:
        """Give back what was reserved, and close. Idempotent."""
        if self._fd >= 0:
            if self._reserved > self.size:
                os.ftruncate(self._fd, self.size + len(self._tail))
            os.close(self._fd)
            self._fd = -1

    def discard(self) -> None:
        """Close it and remove it: nothing of it is of use."""
        self.close()
        with contextlib.suppress(OSError):
            if stat.S_ISREG(self._path.lstat().st_mode):
                self._path.unlink()

    def _put(self, piece: bytes | bytearray) -> None:
        tail, view = self._tail, memoryview(piece)
        if tail:
            os.lseek(self._fd, self.size, os.SEEK_SET)
        try:
            while view:
                view = view[os.write(self._fd, view) :]
            if len(tail) > len(piece):
                os.ftruncate(self._fd, self.size + len(piece))
        except OSError:
            with contextlib.suppress(OSError):  # the first one says more
                self.cut(self.size + len(tail))
                self.size -= len(tail)
                os.pwrite(self._fd, tail, self.size)  # its room is there
            self._tail = tail
            raise

    def _allocate(self, end: int) -> None:
        """Take space up to a size without changing the file's own."""
        while _fallocate(self._fd, _KEEP_SIZE, self.size, end - self.size):
            number = ctypes.get_errno()
            if number != errno.EINTR:
                raise OSError(number, os.strerror(number))
        self._reserved = end


_libc = ctypes.CDLL(None, use_errno=True)
# Under this name the offsets have 64 bits on every machine; musl's other one has, too.
_fallocate = getattr(_libc, "fallocate64", _libc.fallocate)
_fallocate.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64)
