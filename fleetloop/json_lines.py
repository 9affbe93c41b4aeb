"""Objects for programs on standard output, one per line, as things happen (`--json-lines`).

The kinds of lines and their fields are in `docs/json-lines.md`. Nobody waits for a slow reader:
what it has not read is kept, but for pictures of the moment beyond `MOST_UNREAD_BYTES`. At the end
what is kept is written whole. A closed reader is no failure.
"""

import json
import os
import select
import sys
from typing import Any, TextIO

from configs.errors import InfrastructureError
from fleetloop.streams import forget_output, is_utf8

MOST_UNREAD_BYTES = 1 << 20
"""Beyond this, pictures of the moment are left out."""
_AT_ONCE = 4096
"""Bytes that a pipe takes without waiting if it takes any: PIPE_BUF."""


class JsonLines:
    """Writes lines to a stream, standard output by default; `end` writes what is left.

    Raises:
        InfrastructureError: by `end`, that they can't be written, such as to a full disk.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream = stream or sys.stdout
        stream.flush()
        self._fd = _descriptor(stream)
        self._unicode = is_utf8(stream)
        self._unread = bytearray()
        self._poll = select.poll()
        if self._fd is not None:
            self._poll.register(self._fd, select.POLLOUT)
        self._gone = False
        self._failure: OSError | None = None

    def say(self, kind: str, **fields: Any) -> None:
        """Write a line."""
        line = json.dumps({"kind": kind, **fields}, ensure_ascii=not self._unicode, allow_nan=False)
        if not self._gone:
            self._unread += line.encode("utf-8", "backslashreplace") + b"\n"
            self._write(wait=False)

    def picture(self, kind: str, **fields: Any) -> None:
        """Write a line of what another one will replace; a slow reader misses it."""
        self._write(wait=False)
        if len(self._unread) < MOST_UNREAD_BYTES:
            self.say(kind, **fields)

    def end(self) -> None:
        """Write what is left, however long its reader takes."""
        self._write(wait=True)
        failure, self._failure = self._failure, None
        if failure is not None:
            raise InfrastructureError(
                f"can't write the results to standard output: {failure.strerror}"
            )

    def _write(self, *, wait: bool) -> None:
        if self._fd is None:
            self._stream.write(self._unread.decode("utf-8"))
            self._unread.clear()
            return
        while self._unread and not self._gone and self._poll.poll(None if wait else 0):
            try:
                written = os.write(self._fd, self._unread[:_AT_ONCE])
            except BlockingIOError:
                continue
            except OSError as error:
                self._gone = True
                self._unread.clear()
                if not isinstance(error, BrokenPipeError):
                    self._failure = error
                if self._stream is sys.stdout:
                    forget_output()
            else:
                del self._unread[:written]


def _descriptor(stream: TextIO) -> int | None:
    """Of a stream; None of an object of this process."""
    try:
        return stream.fileno()
    except (OSError, ValueError):
        return None
