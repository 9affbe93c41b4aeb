"""What `list` finds, with buses in this process."""

import json
import socket
import threading
from pathlib import Path

import can

from bridge.can_bus import sockets
from bridge.frame import Frame
from fleetloop.can.decoder import protocol_of
from fleetloop.can.listing import connections, list_buses, survey

HEARTBEAT = Frame(0x001, bytes.fromhex("0000000008000000"))


def test_it_hears_rate_and_nodes_and_counts_clients(buses, in_background) -> None:
    over = threading.Event()

    def talk() -> None:
        tick = 0
        while not over.wait(0.001):
            tick += 1
            buses.deliver(HEARTBEAT, stamp_ns=tick * 10_000_000)

    with can.Bus(interface="fleetloop", channel="r1"):
        buses.await_clients(1)
        in_background(talk)
        try:
            first, second = survey(0.3, 1_000_000, protocol_of("odrive"))
        finally:
            over.set()
    assert (first.run, first.bus, first.clients) == ("run", "r1", 1)
    assert abs(first.frames_per_s - 100.0) < 0.01
    assert [(node.node, node.state) for node in first.nodes] == [(0, "CLOSED_LOOP_CONTROL")]
    assert (second.bus, second.clients, second.frames_per_s, second.nodes) == ("r2", 0, None, ())


def test_json_has_every_bus(buses, capsys) -> None:
    assert list_buses(seconds=0.01, bit_rate=500_000, as_json=True) == 0
    reports = json.loads(capsys.readouterr().out)
    assert [(report["run"], report["bus"]) for report in reports] == [("run", "r1"), ("run", "r2")]
    assert reports[0]["load"] is None


def test_the_table_names_runs_and_buses(buses, capsys) -> None:
    assert list_buses(seconds=0.01, bit_rate=1_000_000, as_json=False) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "run run"
    assert [line.split()[0] for line in lines[1:4]] == ["BUS", "r1", "r2"]
    assert "none heard" in lines[2]


def test_a_bus_that_does_not_answer_is_reported_in_bounded_time(runtime_folder, capsys) -> None:
    folder = sockets.create_run_folder("stuck")
    listening = sockets.listen(folder, ("r1",))
    try:
        assert list_buses(seconds=0.01, bit_rate=1_000_000, as_json=False) == 0
    finally:
        listening["r1"].close()
        sockets.remove_run_folder(folder)
    told = capsys.readouterr()
    assert "stuck" in told.out
    assert "no answer in time" in told.err


def test_without_buses_it_says_so(runtime_folder, capsys) -> None:
    assert list_buses(seconds=0.01, bit_rate=1_000_000, as_json=False) == 0
    assert "no bus is up" in capsys.readouterr().err


def test_connections_are_those_of_the_kernel_s_table(tmp_path: Path) -> None:
    path = tmp_path / "s"
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen()
        assert connections(Path("/proc/net/unix"))[str(path)] == 0
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
            client.connect(str(path))
            with listener.accept()[0]:
                assert connections(Path("/proc/net/unix"))[str(path)] == 1
    assert connections(tmp_path / "no table") is None
