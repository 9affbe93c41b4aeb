"""The viewer's process: hears the rows of a run, serves its page, and asks its launcher.

Started by the launcher when the run's door is asked for it (`fleetloop.launch.viewer`). It yields
the processor to everything else (nice 10), and its end is nothing to the run. Asked to stop, it
takes the last rows; once the launcher lets go of it, it shows the run's verdict, and goes.
"""

import asyncio
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from bridge.network import keys
from bridge.network.client import StoppedError, open_client
from bridge.network.link import Arrival, Link, waiting
from bridge.network.messages import Rows
from bridge.network.telemetry import PLANT_ROW, row_of
from bridge.process.lifecycle import Stop, serve, settle_memory
from configs.brief import ViewerBrief
from configs.errors import FleetloopError
from configs.events import KINDS, Event
from configs.loading import loads
from configs.resolve import signals_of
from configs.roles import VIEWER
from configs.scenario import Scenario
from fleetloop.door.async_client import AsyncRunClient
from fleetloop.launch.viewer import PAGE
from fleetloop.live.expected import Source
from fleetloop.live.hub import Hub
from fleetloop.live.past import Block, Kept, feed, recorded
from fleetloop.live.server import LiveServer
from fleetloop.live.state import LiveState
from fleetloop.live.streaming import Streaming
from fleetloop.record.scan import RecordError
from fleetloop.results import run_folder

ROOM_BYTES = 1 << 22
"""Of what waits of one source: a viewer that falls behind misses rows."""
_DRAIN_S, _IDLE_S = 0.04, 0.1
_STATUS_S, _FAULTS_S = 0.2, 0.5
_ASK_S = 5.0
_LOOK_BACK_S, _LEAST_OFTEN_S = 0.5, 8.0
"""First and longest interval at which the record is read for rows from before."""
_LAST_ROWS_S, _LAST_LOOK_S = 0.2, 1.0
"""Of the end: for rows that are on their way, and for browsers to draw the verdict."""


class Heard:
    """The rows of a run on their way into the picture.

    Args:
        scenario: of the run.
        hub: has the picture.
    """

    def __init__(self, scenario: Scenario, hub: Hub) -> None:
        self._hub = hub
        self.kept = Kept()
        self.streaming = Streaming()
        self._row_bytes = {
            f"controller/{robot.name}": row_of(signals_of(scenario, robot)).size
            for robot in scenario.robot
        } | {f"plant/{robot.name}": PLANT_ROW.size for robot in scenario.robot}

    def subscribe(self, link: Link, run: str) -> None:
        """Subscribe to the rows."""
        for robot in self._hub.state.robots:
            link.subscribe(keys.truth(run, robot), f"plant/{robot}", room_bytes=ROOM_BYTES)
            telemetry = keys.telemetry(run, robot)
            link.subscribe(telemetry, f"controller/{robot}", room_bytes=ROOM_BYTES)

    def take(self, arrival: Arrival) -> None:
        """Take a block of rows; what is none is passed over."""
        rows = Rows.decode(arrival.payload, self._row_bytes[arrival.tag])
        state = self._hub.state
        if rows is not None and rows.length and 0 <= rows.first_tick < state.schedule.ticks:
            source, _, robot = arrival.tag.partition("/")
            whose: Source = "plant" if source == "plant" else "controller"
            block = Block(robot, whose, rows.first_tick, rows.rows)
            self.kept.add(block)
            state.hear(*block)
            self.streaming.hear(block)

    def note_events(self, events: Iterable[Event]) -> None:
        """Take events that follow those that are there."""
        state = self._hub.state
        known = len(state.events)
        state.note_events(events)
        self.streaming.note_events(state, known)

    @property
    def watched(self) -> bool:
        """Whether anyone looks."""
        return self._hub.watched or self.streaming.watched


async def _hear(link: Link, heard: Heard, hub: Hub) -> None:
    """Rows, as they come; they are looked at when somebody does."""
    while True:
        for arrival in waiting(link):
            heard.take(arrival)
        if not hub.watched:
            hub.idle()
        await asyncio.sleep(_DRAIN_S if heard.watched else _IDLE_S)


async def _look_back(heard: Heard, hub: Hub, record: Path) -> None:
    """Rows from before the first that was heard, once the record has them."""
    wait_s, size = _LOOK_BACK_S, -1
    while not heard.kept.over:
        await asyncio.sleep(wait_s)
        if heard.kept.follow({}):
            break  # from the beginning
        wait_s = min(2.0 * wait_s, _LEAST_OFTEN_S)
        try:
            if (now := record.stat().st_size) == size:
                continue
            size, state = now, LiveState(hub.state.scenario)
            ends = await asyncio.to_thread(recorded, record, state)
        except (OSError, RecordError):
            continue  # it isn't there yet
        if heard.kept.over:
            break
        whole = heard.kept.follow(ends)
        feed(state, heard.kept.blocks)
        hub.show(state)
        if whole:
            break
    heard.kept.end()


async def _ask(door: AsyncRunClient, heard: Heard, hub: Hub) -> None:
    """The run's status, its faults and events, several times a second."""
    since, faults_s = 0, 0.0
    loop = asyncio.get_running_loop()
    while door.open_:
        try:
            status = await door.ask("run.status", within_s=_ASK_S)
            said = await door.ask("run.events", within_s=_ASK_S, since=since)
            since, hub.state.status = said["next"], status
            heard.note_events(_event(one) for one in said["events"] if one["kind"] in KINDS)
            if loop.time() >= faults_s:
                faults_s = loop.time() + _FAULTS_S
                hub.state.faults = (await door.ask("fault.list", within_s=_ASK_S))["faults"]
        except FleetloopError:
            pass  # the run is ending, or stands still; the page goes on with what it has
        await asyncio.sleep(_STATUS_S if heard.watched else 1.0)


def _event(said: Mapping[str, Any]) -> Event:
    return Event(*(said[key] for key in Event._fields))


async def _serve(brief: ViewerBrief, link: Link, stop: Stop) -> str:
    scenario = loads(run_folder.SCENARIO, brief.scenario_toml, recorded=True)
    door = await AsyncRunClient.open(Path(brief.door))
    hub = Hub(LiveState(scenario), door, brief.network.run)
    server = LiveServer(hub, brief.token)
    heard = Heard(scenario, hub)
    heard.subscribe(link, brief.network.run)
    link.declare_live(keys.live(brief.network.run, VIEWER.name))
    await door.ask("live.listening", token=brief.token, view=PAGE, url=server.address)
    record = Path(brief.folder) / run_folder.RECORD
    going = (
        _hear(link, heard, hub),
        _look_back(heard, hub, record),
        _ask(door, heard, hub),
        heard.streaming.serve(door, hub, brief),
    )
    tasks = [asyncio.create_task(one) for one in going]
    settle_memory()
    while not stop.requested:
        await asyncio.sleep(_IDLE_S)
    await asyncio.sleep(_LAST_ROWS_S)
    for task in tasks:
        task.cancel()
    for arrival in waiting(link):
        heard.take(arrival)
    link.close()
    hub.end()
    heard.streaming.push_last()
    while not stop.released:
        await asyncio.sleep(_DRAIN_S)
    hub.conclude(_summary(Path(brief.folder)))
    await hub.shown(_LAST_LOOK_S)
    server.stop()
    heard.streaming.stop()
    await door.close()
    return f"{hub.state.tick + 1} ticks seen"


def _summary(folder: Path) -> Mapping[str, Any] | None:
    """The summary of the run; None: it has none."""
    try:
        summary: dict[str, Any] = json.loads((folder / run_folder.SUMMARY).read_bytes())
    except (OSError, ValueError):
        return None
    return summary


def run(brief: ViewerBrief, stop: Stop) -> str:
    """Serve the page until told to stop."""
    try:
        link = open_client(brief.network, brief.start_deadline_s, stop)
    except StoppedError:
        return ""
    with link:
        return asyncio.run(_serve(brief, link, stop))


def main() -> int:
    """Serve as the viewer; return the exit status."""
    return serve(ViewerBrief, run, name=VIEWER.name)


if __name__ == "__main__":
    raise SystemExit(main())
