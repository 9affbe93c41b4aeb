"""Rates, load and nodes against closed forms."""

import pytest

from bridge.drives.odrive.frames import AxisError, AxisState
from bridge.frame import EFF, ERR, Frame
from bridge.wire.bits import frame_bits
from fleetloop.can.census import ERROR_FRAME_BITS, Census, Node

ENCODER = Frame(0x009, bytes(range(8)))


def test_load_is_the_share_of_bus_time_that_the_bits_take() -> None:
    census = Census(bit_rate=500_000)
    for tick in range(101):
        for _ in range(2):
            census.count(ENCODER, tick * 2_000_000)
    assert census.seconds == pytest.approx(0.2)
    assert census.rate == pytest.approx(2 / 0.002)
    assert census.load == pytest.approx(2 * frame_bits(ENCODER) / (0.002 * 500_000))


def test_error_frames_take_their_share_and_are_counted_apart() -> None:
    census = Census(bit_rate=1_000_000)
    census.count(ENCODER, 0)
    census.count(Frame(ERR | 0x40, bytes(8)), 1_000_000)
    assert census.error_frames == 1
    assert census.load == pytest.approx(ERROR_FRAME_BITS / 1000)
    assert [node.node for node in census.nodes] == [0]


def test_without_passing_time_there_is_no_rate() -> None:
    census = Census(bit_rate=1_000_000)
    assert (census.rate, census.load, census.bus_time_s) == (None, None, None)
    census.count(ENCODER, 5_000_000)
    assert (census.rate, census.load, census.bus_time_s) == (None, None, 0.005)


def test_nodes_have_the_state_and_errors_of_their_last_heartbeat() -> None:
    census = Census(bit_rate=1_000_000)
    census.count(Frame(0x021, bytes.fromhex("0000000008000000")), 0)
    tripped = int(AxisError.WATCHDOG_TIMER_EXPIRED).to_bytes(4, "little")
    census.count(Frame(0x021, tripped + bytes([AxisState.IDLE, 0, 0, 0])), 1)
    census.count(Frame(0x04E, bytes(4)), 2)
    census.count(Frame(EFF | 0x009, bytes(8)), 3)
    census.count(Frame(0x01E, bytes(8)), 4)
    assert census.nodes == [Node(1, "IDLE", "WATCHDOG_TIMER_EXPIRED"), Node(2, "", "")]
    assert census.other_frames == 2
