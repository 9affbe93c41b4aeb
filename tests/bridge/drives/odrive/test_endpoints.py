"""SDO: parameters by number, as documented bytes and through the axis."""

import struct

import pytest
from drive_bench import MS, Bench

from bridge.drives.odrive.endpoints import Endpoint, Kind, answer
from bridge.drives.odrive.frames import Command, identifier
from bridge.drives.odrive.parameters import FIRST_ENDPOINT


def number(bench: Bench, name: str) -> int:
    return next(n for n, endpoint in bench.node._endpoints.items() if endpoint.name == name)


def read(bench: Bench, name: str, layout: str) -> float:
    (frame,) = bench.tell(Command.RX_SDO, struct.pack("<BHB", 0, number(bench, name), 0))
    assert frame.can_id == identifier(bench.node.node_id, Command.TX_SDO)
    assert struct.unpack_from("<BHB", frame.data) == (0, number(bench, name), 0)
    return struct.unpack_from(layout, frame.data, 4)[0]


def write(bench: Bench, name: str, layout: str, value: float) -> list:
    data = struct.pack("<BHB", 1, number(bench, name), 0) + struct.pack(layout, value)
    return bench.tell(Command.RX_SDO, data)


def test_a_read_has_the_documented_bytes() -> None:
    table = {0x1234: Endpoint("x", Kind.F32, lambda: 0.25)}
    reply = answer(table, bytes.fromhex("00 3412 00"), confirms_writes=False)
    assert reply == bytes.fromhex("00 3412 00 0000803e")


def test_every_endpoint_answers_a_read_with_four_to_eight_bytes() -> None:
    bench = Bench()
    for n in bench.node._endpoints:
        (frame,) = bench.tell(Command.RX_SDO, struct.pack("<BHB", 0, n, 0))
        assert 5 <= len(frame.data) <= 8
    assert min(bench.node._endpoints) == FIRST_ENDPOINT


def test_gains_and_limits_can_be_written_and_read_back() -> None:
    bench = Bench()
    assert write(bench, "axis0.controller.config.vel_limit", "<f", 4.0) == []
    assert read(bench, "axis0.controller.config.vel_limit", "<f") == 4.0
    write(bench, "axis0.controller.config.vel_limit", "<f", -1.0)
    write(bench, "axis0.controller.config.vel_limit", "<f", float("nan"))
    assert read(bench, "axis0.controller.config.vel_limit", "<f") == 4.0


def test_firmware_0_6_11_answers_writes_too() -> None:
    bench = Bench(firmware=(0, 6, 11))
    (frame,) = write(bench, "axis0.controller.config.pos_gain", "<f", 3.0)
    assert struct.unpack_from("<f", frame.data, 4) == (3.0,)


def test_rates_of_messages_can_be_changed() -> None:
    bench = Bench()
    write(bench, "axis0.config.can.iq_msg_rate_ms", "<I", 20)
    write(bench, "axis0.config.can.encoder_msg_rate_ms", "<I", 0)
    said = [frame.can_id & 0x1F for frame in bench.wait(0.2)]
    assert said.count(Command.GET_IQ) == pytest.approx(10, abs=1)
    assert Command.GET_ENCODER_ESTIMATES not in said


def test_the_watchdog_can_be_turned_on_and_off() -> None:
    bench = Bench()
    write(bench, "axis0.config.watchdog_timeout", "<f", 0.05)
    assert read(bench, "axis0.config.enable_watchdog", "<?") == 1
    assert bench.node.watchdog_ns == pytest.approx(50 * MS, abs=10)
    write(bench, "axis0.config.enable_watchdog", "<?", 0)
    assert bench.node.watchdog_ns == 0
