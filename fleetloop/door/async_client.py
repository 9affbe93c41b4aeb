"""A client's end of a door in a loop of asyncio: many requests at once on one connection.

One connection, since the run gives its controls to a connection.
"""

import asyncio
import contextlib
import json
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

from configs.errors import InfrastructureError
from fleetloop.door.client import ANSWER_S, RunEndedError, answered, line_of

_MOST_LINE_BYTES = 1 << 24
"""Of an answer."""


class AsyncRunClient:
    """A connection to the launcher of one run; made by `open`."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._numbers = count()
        self._asked: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._listening = asyncio.create_task(self._listen())
        self.open_ = True
        """Whether the launcher is there."""

    @classmethod
    async def open(cls, path: Path) -> "AsyncRunClient":
        """Connect to the door at a path.

        Raises:
            InfrastructureError: nobody answers there.
        """
        try:
            ends = await asyncio.open_unix_connection(path, limit=_MOST_LINE_BYTES)
        except OSError as error:
            raise InfrastructureError(f"{path}: no answer: {error.strerror}") from error
        return cls(*ends)

    async def ask(
        self, request: str, *, within_s: float | None = ANSWER_S, **arguments: Any
    ) -> Mapping[str, Any]:
        """The answer to a request; `within_s` None: whenever it comes, or the run's end.

        Raises:
            RefusedError: the run says why not.
            RunEndedError: the run has ended.
            InfrastructureError: it doesn't answer in time.
        """
        if not self.open_:
            raise RunEndedError("the run has ended")
        number = next(self._numbers)
        answer: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._asked[number] = answer
        self._writer.write(line_of(request, id=number, **arguments))
        try:
            async with asyncio.timeout(within_s):
                said = await answer
        except TimeoutError as error:
            raise InfrastructureError(f"no answer in {within_s} s") from error
        finally:
            self._asked.pop(number, None)
        return answered(said)

    async def close(self) -> None:
        """End the connection."""
        self._listening.cancel()
        self._writer.close()
        with contextlib.suppress(OSError, asyncio.CancelledError):
            await self._listening

    async def _listen(self) -> None:
        """Give each answer to whoever waits for it."""
        try:
            while line := await self._reader.readline():
                said = json.loads(line)
                waiting = self._asked.get(said.pop("id", None))
                if waiting is not None and not waiting.done():
                    waiting.set_result(said)
        except (OSError, ValueError):
            pass  # it has gone, or is no launcher
        finally:
            self.open_ = False
            for waiting in self._asked.values():
                if not waiting.done():
                    waiting.set_exception(RunEndedError("the run has ended"))
