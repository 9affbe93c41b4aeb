"""Sockets of Zenoh's in this process: none makes the thread that closes it wait for its peer."""

import os
import socket
import struct
from contextlib import ExitStack
from pathlib import Path

from bridge.network import access, keys
from bridge.network.client import open_client
from bridge.network.connections import Connections
from bridge.network.router import open_router
from bridge.network.zenoh_link import ZenohLink
from configs.connections import NetworkLink
from configs.roles import LAUNCHER, PLANT

PLAN = access.plan("test", ("r1",), {"r1": ()}, ("r1",))
TOKEN = keys.live("test", LAUNCHER.name)
BOUND_S = 20.0


def lingering(session: ZenohLink) -> list[bool]:
    """Of each connection of a session, whether close(2) waits for what is under way."""
    peers = {link.dst.partition("/")[2] for link in session._session.info.links()}
    found = []
    for _, connection in Connections().to(peers):
        with connection:
            option = connection.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8)
            found.append(bool(struct.unpack("ii", option)[0]))
    return found


def test_no_connection_lingers_at_either_end_nor_one_that_is_made_again(tmp_path: Path) -> None:
    user = PLANT.identity()
    with open_router(None, PLAN, tmp_path) as router:
        router.declare_live(TOKEN)
        login = NetworkLink("test", router.endpoint, user, PLAN.passwords[user])
        with open_client(login, BOUND_S) as client:
            client.watch_live(TOKEN, "there")
            assert client.receive(BOUND_S).payload == b"1"
            assert (lingering(client), lingering(router)) == ([False], [False])
            router.close()
            assert client.receive(BOUND_S).payload == b"0"
            with open_router(login.endpoint, PLAN, tmp_path) as again:
                again.declare_live(TOKEN)
                assert client.receive(BOUND_S).payload == b"1"
                assert (lingering(client), lingering(again)) == ([False], [False])


def test_looking_at_a_connection_leaves_it_nonblocking_as_zenoh_has_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        host, port = server.getsockname()
        with socket.create_connection((host, port)) as ours:
            ours.setblocking(False)
            for peer, connection in Connections().to({f"{host}:{port}"}):
                assert peer == f"{host}:{port}"
                connection.close()
                break
            else:
                raise AssertionError("not found")
            assert not os.get_blocking(ours.fileno())


def test_a_descriptor_that_has_another_peer_now_is_looked_for_again() -> None:
    connections = Connections()
    with ExitStack() as stack:
        ends = []
        for _ in range(2):
            server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            ends.append(stack.enter_context(socket.create_connection(server.getsockname())))
        first, second = ("{}:{}".format(*end.getpeername()) for end in ends)

        def peers_of(*wanted: str) -> dict[str, str]:
            """By each peer that is found, the one that its connection has."""
            found = {}
            for peer, connection in connections.to(wanted):
                with connection:
                    found[peer] = "{}:{}".format(*connection.getpeername())
            return found

        assert peers_of(first) == {first: first}
        os.dup2(ends[1].fileno(), ends[0].fileno())
        assert peers_of(first) == {}
        assert peers_of(first, second) == {second: second}
