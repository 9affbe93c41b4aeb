"""A run at a Foxglove WebSocket, as a client of the documented protocol has it."""

import asyncio
import json
import re
import sys
from collections import Counter
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from support.foxglove_client import FoxgloveClient
from support.record_rows import packed
from tornado.websocket import websocket_connect

from configs.errors import InfrastructureError, ScenarioError
from configs.events import Event
from configs.loading import load
from configs.resolve import signals_of
from fleetloop.foxglove.server import BACKLOG
from fleetloop.foxglove.stream import Stream
from fleetloop.launch.drawn import drawing
from fleetloop.live.command import open_stream
from fleetloop.live.streaming import opened
from fleetloop.record.foxglove_schemas import schema_text
from fleetloop.record.reader import Record

PERIOD_NS = 2_000_000
EVIL = '{"id": 1, "topic": "evil", "encoding": "json", "schemaName": ""}'
STOPPED = Event(30, "r2", "stopped", "a drive <b>dropped</b> out")


class Bench:
    """A run of two robots that goes on as far as it is told."""

    def __init__(self, record: Record) -> None:
        scenario = load("two_robots")
        tables = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
        self.stream = Stream("two-000001", tables, drawing(scenario), PERIOD_NS)
        self._record = record
        self._tick = 0

    def go_to(self, tick: int) -> None:
        """Rows up to there, and a look at them."""
        begin, self._tick = self._tick, tick
        for robot in self._record.robots:
            plant, controller = self._record.plant[robot], self._record.controller[robot]
            self.stream.hear(robot, "plant", begin, packed(plant[begin:tick]))
            self.stream.hear(robot, "controller", begin, packed(controller[begin:tick]))
        self.stream.push()

    async def until_watched(self, count: int = 1) -> None:
        """Wait for subscriptions: the server takes them on a thread of its own."""
        async with asyncio.timeout(20.0):
            while len(self.stream._server.wanted) < count:
                await asyncio.sleep(0.005)


@pytest.fixture(scope="module")
def served(finished_run: Path) -> Callable[[Callable[[Bench], Awaitable[None]]], None]:
    """Run a test in the loop of a stream."""
    record = Record.open(finished_run / "record.mcap")

    def run(test: Callable[[Bench], Awaitable[None]]) -> None:
        async def body() -> None:
            bench = Bench(record)
            try:
                await test(bench)
            finally:
                bench.stream.stop()

        asyncio.run(body())

    return run


def test_a_client_hears_what_it_subscribes_to_in_the_schemas_of_the_record(served) -> None:
    async def test(bench: Bench) -> None:
        client = await FoxgloveClient.open(bench.stream.address)
        assert client.info["capabilities"] == ["time"]  # nothing that changes anything
        assert len(client.channels) == 7 + 2 * 3
        scene = client.channels["scene/robots"]
        assert scene["schemaName"] == "foxglove_msgs/msg/SceneUpdate"
        assert scene["schema"] == schema_text("foxglove_msgs/SceneUpdate")
        assert client.channels["tf"]["schemaName"] == "foxglove_msgs/msg/FrameTransforms"
        assert '"x_m": "m"' in client.channels["robot/r1/plant"]["metadata"]["units"]
        await client.subscribe("scene/robots", "tf", "robot/r1/plant")
        await bench.until_watched(3)
        bench.go_to(100)
        said = await client.take(4 + 4 + 10)
        assert [one.time_ns for one in said] == sorted(one.time_ns for one in said)
        (truth,) = [it.content for it in said if it[:2] == ("robot/r1/plant", 100_000_000)]
        (frames,) = [it.content for it in said if it[:2] == ("tf", 100_000_000)]
        (drawn,) = [it.content for it in said if it[:2] == ("scene/robots", 100_000_000)]
        assert truth.tick == 50
        frame, entity = frames.transforms[0], drawn.entities[0]
        assert (frame.parent_frame_id, frame.child_frame_id) == ("world", "r1")
        assert (frame.translation.x, frame.translation.y) == (truth.x_m, truth.y_m)
        assert (entity.id, entity.frame_id) == ("robot r1", "world")
        assert entity.lifetime.sec == 2
        assert entity.cubes[0].pose.position.x == truth.x_m
        assert await client.time_ns() == 99 * PERIOD_NS
        await client.close()

    served(test)


def test_one_that_comes_while_the_run_stands_still_sees_it_and_what_has_happened(served) -> None:
    async def test(bench: Bench) -> None:
        bench.stream.note_events([STOPPED])
        bench.go_to(1000)
        for _ in range(2):
            client = await FoxgloveClient.open(bench.stream.address)
            await client.subscribe("scene/paths", "log", "scene/edges")
            await bench.until_watched(3)
            bench.stream.push()
            said = await client.take(1 + 1 + 2)
            assert Counter(it.topic for it in said) == {
                "scene/paths": 1,
                "log": 1,
                "scene/edges": 2,
            }
            (event,) = [it for it in said if it.topic == "log"]
            assert event.time_ns == 30 * PERIOD_NS
            assert event.content.message == "stopped: a drive <b>dropped</b> out"
            (paths,) = [it.content for it in said if it.topic == "scene/paths"]
            assert [entity.id for entity in paths.entities] == ["path r1", "path r2"]
            assert await client.time_ns() == 999 * PERIOD_NS
            await client.close()
            async with asyncio.timeout(20.0):
                while bench.stream.watched:
                    await asyncio.sleep(0.005)

    served(test)


def test_an_event_is_said_once_to_one_that_is_there(served) -> None:
    async def test(bench: Bench) -> None:
        client = await FoxgloveClient.open(bench.stream.address)
        await client.subscribe("log")
        await bench.until_watched()
        bench.stream.push()
        bench.stream.note_events([STOPPED])
        bench.stream.push()
        bench.stream.push()
        bench.stream.note_events([STOPPED._replace(text="again")])
        bench.stream.push()
        texts = [it.content.message for it in await client.take(2)]
        assert texts == ["stopped: a drive <b>dropped</b> out", "stopped: again"]
        await client.close()

    served(test)


def test_one_that_reads_nothing_loses_the_oldest_and_holds_up_nobody(served) -> None:
    async def test(bench: Bench) -> None:
        idle = await FoxgloveClient.open(bench.stream.address)
        await idle.subscribe("scene/robots", decoded=False)
        await bench.until_watched()
        bench.stream.push()
        bench.go_to(50)
        block = [it for _, it in bench.stream._feed.newest({2})] * 10
        count = 0
        while count < 4 * BACKLOG:  # tens of megabytes
            bench.stream._server.send((2, one) for one in block)
            count += sum(map(len, block))
        reader = await FoxgloveClient.open(bench.stream.address)
        await reader.subscribe("tf")
        await bench.until_watched(2)
        bench.go_to(100)
        assert (await reader.take(4))[-1].time_ns == 75 * PERIOD_NS
        heard = 0
        while (await idle.take(1))[0].time_ns < 75 * PERIOD_NS:
            heard += 1
        assert BACKLOG // 2 < heard < count
        await reader.close()
        await idle.close()

    served(test)


@pytest.mark.parametrize(
    ("sent", "answer"),
    [
        ("no JSON", "Invalid message"),
        ('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 999}]}', "Unknown channel"),
        ('{"op": "advertise", "channels": [' + EVIL + "]}", "not support clientPublish"),
        (b"\x01\x01\0\0\0fake", "clientPublish|Unknown channel"),
        (b"\xff" * 1000, "Unknown binary opcode"),
    ],
)
def test_what_a_client_sends_beside_subscriptions_is_refused_and_changes_nothing(
    served, sent: str | bytes, answer: str
) -> None:
    async def test(bench: Bench) -> None:
        socket = await websocket_connect(bench.stream.address, subprotocols=["foxglove.sdk.v1"])
        await socket.write_message(sent, binary=isinstance(sent, bytes))
        texts = [json.loads(await socket.read_message()) for _ in range(3)]
        assert [text["op"] for text in texts] == ["serverInfo", "advertise", "status"]
        assert re.search(answer, texts[2]["message"])
        socket.close()
        assert await socket.read_message() is None
        client = await FoxgloveClient.open(bench.stream.address)
        assert "evil" not in client.channels
        await client.subscribe("scene/paths")
        await bench.until_watched()
        bench.stream.push()
        assert (await client.take(1))[0].topic == "scene/paths"
        await client.close()

    served(test)


def test_its_address_is_one_that_a_page_can_not_guess(served) -> None:
    async def test(bench: Bench) -> None:
        place = urlsplit(bench.stream.address)
        assert place.hostname is not None
        assert place.hostname.startswith("127.")
        with pytest.raises(ConnectionRefusedError):
            await websocket_connect(
                f"ws://127.0.0.1:{place.port}", subprotocols=["foxglove.sdk.v1"]
            )
        hosts = {place.hostname}
        for _ in range(3):
            other = Bench(bench._record)
            hosts.add(urlsplit(other.stream.address).hostname)
            other.stream.stop()
        assert len(hosts) == 4

    served(test)


def test_without_the_extra_it_says_what_to_install(monkeypatch) -> None:
    monkeypatch.delitem(sys.modules, "fleetloop.foxglove.stream")
    monkeypatch.delitem(sys.modules, "fleetloop.foxglove.server")
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(InfrastructureError, match=r"pip install 'fleetloop\[foxglove\]'"):
        opened(SimpleNamespace(), "two-000001")


def test_no_browser_opens_it() -> None:
    with pytest.raises(ScenarioError, match="no browser shows it"):
        open_stream("", show=True, as_json=False)
