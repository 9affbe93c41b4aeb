"""The server of a bus against clients that don't keep to anything: who joins, who is refused."""

import errno
import select
import socket
import subprocess
import sys
import threading

import can
import pytest
from support.strangers import SECRET, Serving, Stranger

from bridge.can_bus import server, sockets
from bridge.can_bus.hub import Hub
from bridge.can_bus.packet import REFUSED, SYNCHRONOUS, WELCOME

# --- whom bus time waits for ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "that the run started, of r1, r2"),
        ("r1", "that the run started"),
        ("r1\0wrong", "that the run started"),
        ("r1\0", "that the run started"),
        ("r2\0" + SECRET, "that the run started"),  # another's
        ("r9\0" + SECRET, "that the run started"),
        ("r1\0ü", "that the run started"),
    ],
)
def test_nobody_but_a_robots_own_controller_is_waited_for(serving, name: str, why: str) -> None:
    refused = serving.join(name, SYNCHRONOUS).hear()
    assert refused.kind == REFUSED
    assert why in refused.text
    assert (serving.hub.clients(), serving.hub.left()) == (0, ())
    assert serving.hub.await_controllers(0.0) == ("r1", "r2")


def test_a_bus_in_real_time_waits_for_nobody(runtime_folder) -> None:
    hub = Hub(sockets.listen(sockets.create_run_folder("hub"), ("r1",)))
    refused = Stranger("r1\0" + SECRET, SYNCHRONOUS)
    for _ in range(3):
        hub.serve(0.0)
    assert "this bus has none" in refused.hear().text
    refused.socket.close()
    hub.close("")
    sockets.remove_run_folder(sockets.base_folder() / "hub")


def test_a_second_controller_of_a_robot_is_refused_while_the_first_is_there(serving) -> None:
    first = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    assert first.hear().kind == WELCOME
    second = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    assert "the controller of r1 is on it already" in second.hear().text
    assert serving.hub.await_controllers(0.0) == ("r2",)
    assert serving.hub.left() == ()
    first.socket.close()
    serving.serve()
    assert serving.hub.left() == ("r1",)


def test_a_stranger_that_says_a_robots_name_unsynchronised_and_leaves_is_not_its_controller(
    serving,
) -> None:
    stranger = serving.join(f"r1\0{SECRET}")
    assert stranger.hear().kind == WELCOME
    stranger.socket.close()
    serving.serve()
    assert serving.hub.left() == ()


def test_the_bus_interface_says_why_it_was_refused(serving) -> None:
    def refusal(**options) -> str:
        caught: list[str] = []

        def join() -> None:
            with pytest.raises(can.CanInitializationError) as error:
                can.Bus(interface="fleetloop", channel="hub/r1", **options)
            caught.append(str(error.value))

        opener = threading.Thread(target=join)
        opener.start()
        while opener.is_alive():
            serving.hub.serve(0.01)
        return caught[0]

    assert "refused: synchronous is for the controllers" in refusal(
        synchronous="r1", secret="guessed"
    )
    assert "refused: synchronous is for the controllers" in refusal(synchronous="r1")
    assert "must name the robot" in refusal(synchronous=True)
    assert "must name the robot" in refusal(synchronous=3)


# --- who connects and says nothing ----------------------------------------------------------------


def test_any_number_of_connections_that_say_nothing_keep_nobody_out(serving) -> None:
    silent = []
    for _ in range(3 * server.MAX_UNIDENTIFIED):
        silent.append(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
        silent[-1].connect(str(sockets.socket_path(sockets.base_folder() / "hub", "r1")))
        serving.serve()
    assert serving.join().hear().kind == WELCOME
    assert serving.join(f"r1\0{SECRET}", SYNCHRONOUS).hear().kind == WELCOME
    ended = [select.select([one], [], [], 0.0)[0] and not one.recv(1) for one in silent]
    assert sum(map(bool, ended)) >= 2 * server.MAX_UNIDENTIFIED
    for one in silent:
        one.close()


def test_who_finds_the_way_in_crowded_waits_for_its_turn(
    runtime_folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sockets, "_BACKLOG", 0)
    serving = Serving()
    crowd = [socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(4)]
    for one in crowd:
        one.setblocking(False)
    path = str(sockets.socket_path(sockets.base_folder() / "hub", "r1"))
    assert errno.EAGAIN in [one.connect_ex(path) for one in crowd]
    with pytest.raises(can.CanInitializationError, match="no answer in time"):
        can.Bus(interface="fleetloop", channel="r1", connect_timeout=0.05)
    opened: list[can.BusABC] = []
    opener = threading.Thread(
        target=lambda: opened.append(can.Bus(interface="fleetloop", channel="r1"))
    )
    opener.start()
    while opener.is_alive():
        serving.hub.serve(0.01)
    opened[0].shutdown()
    for one in crowd:
        one.close()
    serving.close()


# --- no descriptor left --------------------------------------------------------------------------


FULL = """
import os, resource, sys
from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub

with sockets.run_folder("full") as folder:
    hub = Hub(sockets.listen(folder, ("r1",)))
    last = os.dup(0)
    os.close(last)
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (last, hard))
    print(folder / "r1.can", flush=True)
    hub.serve(30.0)
    hub.serve(0.0)
    print(sum(hub.serve(0.01) is None for _ in range(3)), flush=True)
    resource.setrlimit(resource.RLIMIT_NOFILE, (last + 8, hard))
    while not hub.clients():
        hub.serve(30.0)
    hub.close("done")
"""


def test_a_client_for_which_there_is_no_descriptor_is_told_so_and_the_next_is_taken() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", FULL], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    with process, process.stdout as said:
        channel = said.readline().strip()
        with pytest.raises(can.CanInitializationError, match=r"too many open files .*ulimit -n"):
            can.Bus(interface="fleetloop", channel=channel)
        assert said.readline() == "3\n"
        with (
            can.Bus(interface="fleetloop", channel=channel) as bus,
            pytest.raises(can.CanOperationError, match="done"),
        ):
            bus.recv(10.0)
        assert process.wait(30) == 0
