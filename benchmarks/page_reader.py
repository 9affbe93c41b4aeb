"""A browser elsewhere: reads the live page of the run that goes on, and draws nothing.

It loads the page, opens its websocket, and answers each frame as the page's script does. When the
run has ended it prints a line of JSON: frames, and the seconds between the first and the last. It
yields the processor to all others (nice 19), as what is elsewhere takes none.
"""

import asyncio
import json
import os
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from bokeh.client.websocket import WebSocketClientConnectionWrapper
from bokeh.protocol import Protocol
from bokeh.protocol.receiver import Receiver
from tornado.httpclient import AsyncHTTPClient, HTTPRequest
from tornado.websocket import websocket_connect

from configs.errors import FleetloopError
from fleetloop.door.client import open_run

WAIT_S = 120.0
LOOK_EVERY_S = 0.2


def address() -> str:
    """The address of the run's page, once there is a run."""
    deadline_s = time.monotonic() + WAIT_S
    while True:
        try:
            with open_run("") as run:
                return str(run.ask("live.open")["url"])
        except FleetloopError:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(LOOK_EVERY_S)


class Reader:
    """One connection to the page."""

    def __init__(self, socket: Any) -> None:
        self._connection = WebSocketClientConnectionWrapper(socket)
        self._receiver = Receiver(Protocol())
        self._heard = ""
        self.frames = 0
        self.began_s = self.ended_s = 0.0

    @classmethod
    async def open(cls, url: str) -> "Reader":
        """Load the page, and its document."""
        parts = urlsplit(url)
        page = await AsyncHTTPClient().fetch(url, request_timeout=WAIT_S)
        token = re.search(r'"token":"([^"]+)"', page.body.decode())
        if token is None:
            raise ConnectionError(f"{url}: a page without a session")
        request = HTTPRequest(
            f"ws://{parts.netloc}/ws?bokeh-protocol-version=1.0&{parts.query}",
            headers={"Origin": f"http://{parts.netloc}"},
        )
        reader = cls(await websocket_connect(request, subprotocols=["bokeh", token[1]]))
        await reader._message()  # the server is ready
        await Protocol().create("PULL-DOC-REQ").send(reader._connection)
        roots = (await reader._message()).content["doc"]["roots"]
        names = {root["attributes"].get("name"): root["id"] for root in roots}
        reader._heard = names["heard"]
        await reader._answer(0)
        return reader

    async def read(self) -> None:
        """Read to the end."""
        while (message := await self._message()) is not None:
            for buffer in message.buffers:  # only frames have any
                number = int(np.frombuffer(buffer.to_bytes(), "<f8")[0])
                self.ended_s = time.monotonic()
                self.began_s = self.began_s or self.ended_s
                self.frames += 1
                if number % 6 == 0:
                    await self._answer(number)

    async def _message(self) -> Any:
        while True:
            fragment = await self._connection.read_message()
            if fragment is None:
                return None
            if (message := await self._receiver.consume(fragment)) is not None:
                return message

    async def _answer(self, number: int) -> None:
        changed = {
            "kind": "ModelChanged",
            "model": {"id": self._heard},
            "attr": "data",
            "new": {"type": "map", "entries": [["frame", [number]]]},
        }
        header = {"msgid": str(number), "msgtype": "PATCH-DOC"}
        for fragment in (header, {}, {"events": [changed]}):
            await self._connection.write_message(json.dumps(fragment))


async def read(url: str) -> Reader:
    """Read the page at an address."""
    reader = await Reader.open(url)
    await reader.read()
    return reader


def main() -> None:
    """Read the page of the run that goes on."""
    os.setsid()
    os.nice(19)
    with suppress(OSError):  # a kernel without autogroups has no such file
        Path("/proc/self/autogroup").write_text("19", "ascii")
    reader = asyncio.run(read(address()))
    print(json.dumps({"frames": reader.frames, "seconds": reader.ended_s - reader.began_s}))


if __name__ == "__main__":
    main()
