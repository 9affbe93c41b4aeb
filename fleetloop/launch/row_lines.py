"""The sockets over which this machine's processes hand their rows to the recorder.

Made before the processes, one pair for each that has rows. The launcher keeps the processes' ends,
so that one that is started again goes on with the same; the recorder's it gives away.
"""

import socket
from collections.abc import Iterable
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from bridge.network import row_socket
from configs.errors import InfrastructureError


class RowLines:
    """The pairs of one run; a context manager that closes what the launcher has of them.

    Args:
        processes: on this machine, with rows.

    Raises:
        InfrastructureError: no more files can be opened.
    """

    def __init__(self, processes: Iterable[str]) -> None:
        self._ends: dict[str, socket.socket] = {}
        self._of_recorder: dict[str, socket.socket] = {}
        self._open = ExitStack()
        try:
            for process in processes:
                own, recorders = row_socket.pair()
                self._ends[process] = self._open.enter_context(own)
                self._of_recorder[process] = self._open.enter_context(recorders)
        except OSError as error:
            self._open.close()
            raise InfrastructureError(
                f"can't open a socket for the rows of {process}: {error.strerror}"
            ) from error

    def end(self, process: str) -> list[int]:
        """The descriptor of a process's end, if it has one."""
        return [self._ends[process].fileno()] if process in self._ends else []

    @property
    def of_recorder(self) -> dict[str, int]:
        """The descriptors of the recorder's ends, by process."""
        return {process: end.fileno() for process, end in self._of_recorder.items()}

    def given(self) -> None:
        """The recorder has its ends: once it has gone, senders shall find nobody there."""
        for end in self._of_recorder.values():
            end.close()
        self._of_recorder.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._open.close()
