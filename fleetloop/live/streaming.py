"""The viewer's Foxglove WebSocket, from when its launcher says that it is wanted."""

import asyncio
import contextlib
from typing import TYPE_CHECKING, Any

from configs.brief import ViewerBrief
from configs.errors import FleetloopError, InfrastructureError
from configs.resolve import signals_of
from fleetloop.door.async_client import AsyncRunClient
from fleetloop.door.client import RunEndedError
from fleetloop.launch.drawn import drawing
from fleetloop.launch.viewer import FOXGLOVE
from fleetloop.live.hub import Hub
from fleetloop.live.past import Block
from fleetloop.live.state import LiveState

if TYPE_CHECKING:  # it needs an extra
    from fleetloop.foxglove.stream import Stream

_PUSH_S = 0.04
"""From one look at what there is to say to the next."""


class Streaming:
    """Where the rows of a run are to be seen beside the page; nowhere until it is wanted."""

    def __init__(self) -> None:
        self._stream: Stream | None = None

    @property
    def watched(self) -> bool:
        """Whether a client has subscribed to anything."""
        return self._stream is not None and self._stream.watched

    def hear(self, block: Block) -> None:
        """Take a block of rows."""
        if self._stream is not None:
            self._stream.hear(*block)

    def note_events(self, state: LiveState, known: int) -> None:
        """Take the events of the picture but for the first so many."""
        if self._stream is not None:
            self._stream.note_events(state.events[known:])

    async def serve(self, door: AsyncRunClient, hub: Hub, brief: ViewerBrief) -> None:
        """Wait until it is wanted, open it, and send what is new until the run ends."""
        said: dict[str, Any] = {"token": brief.token, "view": FOXGLOVE}
        with contextlib.suppress(RunEndedError):
            while self._stream is None:
                await door.ask("live.wanted", token=brief.token, within_s=None)
                try:
                    self._stream = opened(hub.state, brief.network.run)
                except FleetloopError as error:
                    await door.ask("live.refused", **said, why=str(error))
            await door.ask("live.listening", **said, url=self._stream.address)
            while True:
                self._stream.push()
                await asyncio.sleep(_PUSH_S)

    def push_last(self) -> None:
        """Send what came last."""
        if self._stream is not None:
            self._stream.push()

    def stop(self) -> None:
        """End it, and all connections."""
        if self._stream is not None:
            self._stream.stop()


def opened(state: LiveState, run: str) -> "Stream":
    """A Foxglove WebSocket that knows the events so far.

    Raises:
        InfrastructureError: there can be none here.
    """
    try:
        from fleetloop.foxglove.stream import Stream
    except ModuleNotFoundError as error:
        raise InfrastructureError(
            f"no module {error.name}: pip install 'fleetloop[foxglove]' brings foxglove-sdk"
        ) from error
    scenario = state.scenario
    tables = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
    stream = Stream(run, tables, drawing(scenario), state.schedule.period_ns)
    stream.note_events(state.events)
    return stream
