"""A client of the Foxglove WebSocket protocol, from its documentation: JSON texts, binary messages.

A binary message begins with its kind: 1 is a message (subscription u32, time u64, content), 2 the
time of the server (u64).
"""

import asyncio
import json
import struct
from typing import Any, NamedTuple, Self

from mcap_ros2._dynamic import generate_dynamic
from tornado.websocket import WebSocketClientConnection, websocket_connect

WAIT_S = 20.0
_MESSAGE, _TIME = struct.Struct("<BIQ"), struct.Struct("<BQ")


class Said(NamedTuple):
    """A message of a channel."""

    topic: str
    time_ns: int
    content: Any


class FoxgloveClient:
    """One connection; made by `open`."""

    def __init__(self, socket: WebSocketClientConnection) -> None:
        self._socket = socket
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self._times_ns: list[int] = []
        self._subscribed: dict[int, tuple[str, Any]] = {}

    @classmethod
    async def open(cls, address: str) -> Self:
        """Connect; hear who serves, and which channels."""
        client = cls(await websocket_connect(address, subprotocols=["foxglove.sdk.v1"]))
        client.info = json.loads(await client._read())
        assert client.info["op"] == "serverInfo"
        advertised = json.loads(await client._read())
        assert advertised["op"] == "advertise"
        client.channels = {one["topic"]: one for one in advertised["channels"]}
        return client

    async def subscribe(self, *topics: str, decoded: bool = True) -> None:
        """Ask for channels; without `decoded` the content of their messages is bytes."""
        wanted = []
        for topic in topics:
            channel = self.channels[topic]
            assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
            name = channel["schemaName"]
            number = 100 + len(self._subscribed)
            decoders = generate_dynamic(name, channel["schema"])
            self._subscribed[number] = topic, decoders[name] if decoded else bytes
            wanted.append({"id": number, "channelId": channel["id"]})
        await self._socket.write_message(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    async def take(self, count: int) -> list[Said]:
        """So many messages, decoded by the schemas that were advertised."""
        said: list[Said] = []
        while len(said) < count:
            message = await self._read()
            assert isinstance(message, bytes), message
            if message[0] == 2:
                self._times_ns.append(_TIME.unpack(message)[1])
                continue
            kind, number, time_ns = _MESSAGE.unpack_from(message)
            assert kind == 1
            topic, decode = self._subscribed[number]
            said.append(Said(topic, time_ns, decode(message[_MESSAGE.size :])))
        return said

    async def time_ns(self) -> int:
        """The next time of the server that wasn't asked for; it may come after later messages."""
        while not self._times_ns:
            message = await self._read()
            assert isinstance(message, bytes), message
            assert message[0] == 2
            self._times_ns.append(_TIME.unpack(message)[1])
        return self._times_ns.pop(0)

    async def _read(self) -> Any:
        message = await asyncio.wait_for(self._socket.read_message(), WAIT_S)
        assert message is not None, "closed"
        return message

    async def close(self) -> None:
        """Leave, whatever is still to be read."""
        self._socket.close()
        async with asyncio.timeout(WAIT_S):
            while await self._socket.read_message() is not None:
                pass
