"""The sockets over which this machine's processes hand their rows to the recorder.

The launcher makes a pair for a process when it starts it, first or again, and gives both ends away:
one to the process, the other, over a socket of its own, to the recorder.
"""

import socket
from types import TracebackType
from typing import Self

from bridge.network import row_socket
from configs.errors import InfrastructureError

_HAND_OVER_S = 5.0


class RowLines:
    """The way to the recorder of one run; a context manager that closes it.

    Raises:
        InfrastructureError: no more files can be opened; so does `connect`.
    """

    def __init__(self) -> None:
        try:
            self._handing_over, self._recorders = row_socket.pair()
        except OSError as error:
            raise _no_socket("recorder", error) from error
        self._handing_over.settimeout(_HAND_OVER_S)

    @property
    def recorders(self) -> int:
        """The descriptor on which the recorder takes its ends."""
        return self._recorders.fileno()

    def given(self) -> None:
        """The recorder has it: once it has gone, nobody shall find anyone there."""
        self._recorders.close()

    def connect(self, process: str) -> socket.socket:
        """The end of a process that is to be started."""
        try:
            own, recorders = row_socket.pair()
        except OSError as error:
            raise _no_socket(process, error) from error
        with recorders:
            try:
                row_socket.hand_over(self._handing_over, process, recorders)
            except BrokenPipeError:
                pass  # the recorder has ended: who sends finds nobody
            except OSError as error:
                own.close()
                raise _no_socket(process, error) from error
        return own

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._handing_over.close()
        self._recorders.close()


def _no_socket(process: str, error: OSError) -> InfrastructureError:
    return InfrastructureError(f"can't open a socket for the rows of {process}: {error}")
