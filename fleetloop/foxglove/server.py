"""A Foxglove WebSocket server: channels of a record, of which clients hear what they subscribe to.

foxglove-sdk serves. It knows no token and takes any origin, so the address is what a page in a
browser would have to guess: one of 2^24 of the loopback network, at a port that is free. Other
users of this machine see it among its sockets. Clients can read, and nothing else.
"""

import logging
import secrets
import threading
from collections.abc import Iterable
from operator import itemgetter
from typing import NamedTuple

import foxglove
import numpy as np
from foxglove.websocket import Capability, ChannelView, Client, ServerListener

from configs.errors import InfrastructureError
from fleetloop.record.messages import unframed
from fleetloop.record.schema import Layout, SchemaText

BACKLOG = 1 << 13
"""Messages that wait for a client; beyond that it loses the oldest."""


class _Subscriber(NamedTuple):
    """A client that has subscribed to a channel."""

    client: int
    channel: int


class FoxgloveServer:
    """Serves the channels of a run from threads of its own; `stop` ends it.

    Args:
        layout: of its record.
        run: the name of the run.

    Raises:
        InfrastructureError: it can't listen.
    """

    def __init__(self, layout: Layout, run: str) -> None:
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        self._context = context = foxglove.Context()  # channels end with it
        schemas = {one.number: _schema(one) for one in layout.schemas()}
        self._channels = {
            number: foxglove.Channel(
                layout.topic(number),
                schema=schemas[layout.schema_number(number)],
                message_encoding="cdr",
                metadata=layout.metadata(number),
                context=context,
            )
            for number in layout.channels
        }
        self._heard = _Subscriptions({it.id(): n for n, it in self._channels.items()})
        host = _address()
        try:
            self._server = foxglove.start_server(
                name=f"Fleetloop {run}",
                host=host,
                port=0,
                capabilities=[Capability.Time],
                server_listener=self._heard,
                context=context,
                session_id=run,
                message_backlog_size=BACKLOG,
            )
        except Exception as error:  # it says which only in words
            raise InfrastructureError(f"{host}: can't serve there: {error}") from error
        self.address = f"ws://{host}:{self._server.port}"

    @property
    def wanted(self) -> frozenset[int]:
        """Channels with a subscriber."""
        return self._heard.wanted

    def newcomers(self) -> dict[int, set[int]]:
        """Clients that have subscribed since the last call, each with the channels."""
        return self._heard.newcomers()

    def tell_time(self, time_ns: int) -> None:
        """Tell all clients how late it is in the run."""
        self._server.broadcast_time(time_ns)

    def send(self, messages: Iterable[tuple[int, np.ndarray]], client: int | None = None) -> None:
        """Send messages, in the order of their times; only to one client, if it is named.

        Args:
            messages: by channel, as `fleetloop.record.messages` makes them.
            client: its number.
        """
        found = [(*one, channel) for channel, block in messages for one in unframed(block)]
        for time_ns, content, channel in sorted(found, key=itemgetter(0)):
            self._channels[channel].log(content, log_time=time_ns, sink_id=client)

    def stop(self) -> None:
        """End it, and all connections."""
        self._server.stop()


class _Subscriptions(ServerListener):
    """Who hears what; told by threads of the server.

    Args:
        numbers: of our channels by the server's.
    """

    def __init__(self, numbers: dict[int, int]) -> None:
        self._numbers = numbers
        self._lock = threading.Lock()
        self._there: set[_Subscriber] = set()
        self._new: list[_Subscriber] = []
        self.wanted: frozenset[int] = frozenset()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Note a subscriber."""
        subscriber = _Subscriber(client.id, self._numbers[channel.id])
        with self._lock:
            self._there.add(subscriber)
            self._new.append(subscriber)
            self.wanted |= {subscriber.channel}

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Forget a subscriber, also one whose connection has ended."""
        with self._lock:
            self._there.discard(_Subscriber(client.id, self._numbers[channel.id]))
            self.wanted = frozenset(it.channel for it in self._there)

    def newcomers(self) -> dict[int, set[int]]:
        """Clients that have subscribed since the last call and are there, with the channels."""
        found: dict[int, set[int]] = {}
        with self._lock:
            new, self._new = self._new, []
            for subscriber in new:
                if subscriber in self._there:
                    found.setdefault(subscriber.client, set()).add(subscriber.channel)
        return found


def _schema(schema: SchemaText) -> foxglove.Schema:
    return foxglove.Schema(name=schema.name, encoding="ros2msg", data=schema.text.encode())


def _address() -> str:
    """An address of 127.0.0.0/8 that nobody can guess."""
    second, third, fourth = secrets.token_bytes(3)
    return f"127.{second}.{third}.{min(max(fourth, 1), 254)}"
