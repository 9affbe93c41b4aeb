"""Somebody at the bus stops a robot that runs in real time, and lets it go on."""

from pathlib import Path

import can
import pytest
from support.processes import running

from bridge.drives.odrive.frames import AxisState, Command, decode_heartbeat, identifier

pytestmark = [pytest.mark.system, pytest.mark.wall_clock]


def say(bus: can.BusABC, node: int, command: Command) -> None:
    bus.send(can.Message(arbitration_id=identifier(node, command), is_extended_id=False))


def await_state(bus: can.BusABC, nodes: set[int], state: AxisState) -> float:
    """Return the bus time at which the last of these drives said that it is in this state."""
    waiting = set(nodes)
    while waiting:
        message = bus.recv(5.0)
        assert message is not None
        for node in nodes:
            if message.arbitration_id == identifier(node, Command.HEARTBEAT):
                there = decode_heartbeat(message.data).state == state
                (waiting.discard if there else waiting.add)(node)
    return message.timestamp


def test_an_estop_stops_both_wheels_until_somebody_clears_it(tmp_path: Path) -> None:
    args = ("realtime_100hz", "--set", "host.rearm=true", "--duration", "6")
    with running(tmp_path / "a", *args, bus_time_s=1.0) as run:
        with can.Bus(interface="fleetloop", channel="r1") as bus:
            await_state(bus, {0, 1}, AxisState.CLOSED_LOOP_CONTROL)
            say(bus, 1, Command.ESTOP)
            stopped_s = await_state(bus, {0, 1}, AxisState.IDLE)
            while bus.recv(5.0).timestamp < stopped_s + 1.0:
                pass
            say(bus, 1, Command.CLEAR_ERRORS)
            await_state(bus, {0, 1}, AxisState.CLOSED_LOOP_CONTROL)
        status, out = run.end()
    assert status in (0, 1), out
    notices = run.summary()["notices"]["r1"]
    assert [notice.split(": ")[1] for notice in notices] == ["stopped", "rearming", "rearmed"]
    assert "left drive (node 1) dropped out: ESTOP_REQUESTED" in notices[0]
    assert run.summary()["stopped_robots"] == {}


def test_a_dry_run_says_so_and_moves_nothing(tmp_path: Path) -> None:
    args = ("realtime_100hz", "--set", "host.dry_run=true", "--duration", "1")
    with running(tmp_path / "a", *args, bus_time_s=0.6) as run:
        with can.Bus(interface="fleetloop", channel="r1") as bus:
            messages = [bus.recv(5.0) for _ in range(60)]
        status, out = run.end()
    said = {message.arbitration_id & 0x1F for message in messages}
    assert said <= {Command.HEARTBEAT, Command.GET_ENCODER_ESTIMATES}
    assert status in (0, 1), out
    assert "r1: dry run: nothing was sent to the drives" in out
