"""A browser without a screen: pulls the document of a live page, takes frames, sends orders."""

import asyncio
import json
import re
from collections.abc import Callable
from typing import Any, Self
from urllib.parse import urlsplit

from bokeh.client.websocket import WebSocketClientConnectionWrapper
from bokeh.document import Document
from bokeh.protocol import Protocol
from bokeh.protocol.receiver import Receiver
from tornado.httpclient import AsyncHTTPClient, HTTPRequest
from tornado.websocket import websocket_connect

WAIT_S = 20.0


def socket_address(address: str) -> str:
    """The address of the websocket of a page."""
    parts = urlsplit(address)
    return f"ws://{parts.netloc}/ws?bokeh-protocol-version=1.0&{parts.query}"


async def session_token(address: str) -> str:
    """Load a page; the token of the session that comes with it."""
    page = await AsyncHTTPClient().fetch(address)
    found = re.search(r'"token":"([^"]+)"', page.body.decode())
    assert found is not None
    return found[1]


class HeadlessPage:
    """One viewer; `draws`: it says of each frame that it has drawn it, as a browser does."""

    def __init__(self, socket: Any, *, draws: bool) -> None:
        self._draws = draws
        self._connection = WebSocketClientConnectionWrapper(socket)
        self._protocol = Protocol()
        self._receiver = Receiver(self._protocol)
        self.document = Document()
        self.frames = 0
        self.boards: list[dict[str, Any]] = []
        self._numbers = 0
        self._sent: set[asyncio.Task[int]] = set()

    @classmethod
    async def open(cls, address: str, *, draws: bool = True) -> Self:
        """Load the page and begin as its script does."""
        origin = "http://" + urlsplit(address).netloc
        request = HTTPRequest(socket_address(address), headers={"Origin": origin})
        token = await session_token(address)
        page = cls(await websocket_connect(request, subprotocols=["bokeh", token]), draws=draws)
        await page.take()  # the server is ready
        await page._send(page._protocol.create("PULL-DOC-REQ"))
        (await page.take()).push_to_document(page.document)
        page.set("heard", {"frame": [0]})
        return page

    async def take(self) -> Any:
        """The next message whole; what it patches is patched."""
        while True:
            fragment = await asyncio.wait_for(self._connection.read_message(), WAIT_S)
            if fragment is None:
                raise ConnectionError("closed")
            message = await self._receiver.consume(fragment)
            if message is None:
                continue
            if message.msgtype == "PATCH-DOC":
                message.apply_to_document(self.document)
                self._look()
            return message

    def _look(self) -> None:
        frame = self._data("feed")["frame"]
        if len(frame) and frame[0] > self.frames:
            self.frames = int(frame[0])
            if self._draws:
                self.set("heard", {"frame": [self.frames]})
        text = self._data("board")["json"][0]
        if text and (not self.boards or json.loads(text) != self.boards[-1]):
            self.boards.append(json.loads(text))

    async def until(self, reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first board with which this is so."""
        async with asyncio.timeout(WAIT_S):
            while not (self.boards and reached(self.boards[-1])):
                await self.take()
        return self.boards[-1]

    async def order(self, request: str, **arguments: Any) -> dict[str, Any]:
        """The answer to an order."""
        self._numbers += 1
        order = {"id": self._numbers, "request": request, **arguments}
        self.set("orders", {"json": [json.dumps(order)]})
        seen = len(self.boards)
        async with asyncio.timeout(WAIT_S):
            while True:
                for board in self.boards[seen:]:
                    for answer in board["answers"]:
                        if answer["id"] == self._numbers:
                            return dict(answer)
                seen = len(self.boards)
                await self.take()

    def set(self, name: str, data: dict[str, Any]) -> None:
        """Change a source, as the script does."""
        model = self.document.get_model_by_name(name)
        assert model is not None
        events: list[Any] = []
        self.document.on_change(events.append)
        model.data = data
        self.document.remove_on_change(events.append)
        task = asyncio.create_task(self._send(self._protocol.create("PATCH-DOC", events[:1])))
        self._sent.add(task)
        task.add_done_callback(self._sent.discard)

    def _data(self, name: str) -> Any:
        return self.document.get_model_by_name(name).data

    async def _send(self, message: Any) -> int:
        sent: int = await message.send(self._connection)
        return sent

    def close(self) -> None:
        """Leave."""
        self._connection.close()
