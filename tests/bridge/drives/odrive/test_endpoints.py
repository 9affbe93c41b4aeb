"""Endpoints and functions of an axis, as RxSdo reads, writes and calls them."""

import struct

import pytest
from support.odrive_axis import MS, NODE, NUMBER, arm, axis, floats, modes, read, tell, write

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.endpoints import ENDPOINTS, flat_endpoints
from bridge.drives.odrive.frames import AxisError, AxisState, Command
from bridge.drives.odrive.functions import FUNCTIONS
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import RTR, Frame

SECOND = 1000 * MS


def call(node: OdriveNode, path: str, argument: bytes = b"", now_ns: int = 0) -> list[Frame]:
    number = next(n for n, function in FUNCTIONS.items() if function.path == path)
    return tell(node, Command.RX_SDO, struct.pack("<BHB", 1, number, 0) + argument, now_ns)


def test_every_endpoint_reads_as_its_type() -> None:
    for endpoint in ENDPOINTS.values():
        read(axis(), endpoint.path, endpoint.code)


def test_endpoints_say_what_messages_say() -> None:
    node = arm(axis())
    node.update_encoder(1.5, 0.25)
    assert read(node, "vbus_voltage") == 24.0
    assert read(node, "axis0.pos_estimate") == 1.5
    assert read(node, "axis0.current_state", "B") == 8
    assert read(node, "axis0.is_armed", "?") is True
    tell(node, Command.ESTOP)
    assert read(node, "axis0.active_errors", "I") == 0x0200_0000


def test_writing_is_answered_from_firmware_0_6_11_on_and_acts_before() -> None:
    path = "axis0.controller.config.vel_gain"
    old, new = axis(), axis(firmware_version=(0, 6, 11))
    assert write(old, path, 0.5) == []
    (reply,) = write(new, path, 0.5)
    assert struct.unpack("<BHBf", reply.data) == (0, NUMBER[path], 0, 0.5)
    assert read(old, path) == read(new, path) == 0.5


def test_a_cyclic_message_is_turned_on_and_off_by_its_rate() -> None:
    node = axis(heartbeat_period_ns=0, encoder_period_ns=0)
    assert not node.due(0)
    write(node, "axis0.config.can.temperature_msg_rate_ms", 20, "I")
    assert node.next_due_ns == 20 * MS
    (frame,) = node.due(20 * MS)
    assert frame.can_id == f.identifier(NODE, Command.GET_TEMPERATURE)
    write(node, "axis0.config.can.temperature_msg_rate_ms", 0, "I")
    assert not node.due(SECOND)


def test_a_watchdog_that_is_turned_on_counts_from_then_on() -> None:
    node = arm(axis(watchdog_ns=0))
    write(node, "axis0.config.watchdog_timeout", 0.05)
    data = struct.pack("<BHB?", 1, NUMBER["axis0.config.enable_watchdog"], 0, True)
    tell(node, Command.RX_SDO, data, 60 * SECOND)
    node.due(60 * SECOND + 50 * MS)
    assert node.state is AxisState.CLOSED_LOOP_CONTROL
    node.due(60 * SECOND + 51 * MS)
    assert node.errors == AxisError.WATCHDOG_TIMER_EXPIRED


@pytest.mark.parametrize(
    "data",
    [
        b"\0",
        b"\0\1\0",
        struct.pack("<BHB", 0, 0xFFFF, 0),
        struct.pack("<BHBf", 2, 1, 0, 1.0),
        struct.pack("<BHBf", 1, 1, 0, 1.0),
        struct.pack("<BHBf", 1, NUMBER["axis0.controller.config.vel_gain"], 0, float("nan")),
        struct.pack("<BHBH", 1, NUMBER["axis0.controller.config.vel_gain"], 0, 1),
    ],
    ids=["1 byte", "3 bytes", "unknown", "opcode 2", "read-only", "NaN", "short value"],
)
def test_endpoint_requests_that_make_no_sense_get_no_answer_and_change_nothing(data) -> None:
    node = axis(firmware_version=(0, 6, 11))
    assert tell(node, Command.RX_SDO, data) == []
    assert not node.on_frame(Frame(f.identifier(NODE, Command.RX_SDO) | RTR, bytes(8)), 0)
    assert read(node, "axis0.controller.config.vel_gain") == pytest.approx(1 / 6)


def test_the_table_comes_in_the_form_of_the_vendors_file() -> None:
    flat = flat_endpoints((0, 6, 10))
    said = axis().on_frame(f.request(NODE, Command.GET_VERSION), 0)[0].data
    assert flat["fw_version"] == ".".join(map(str, said[4:7])) == "0.6.10"
    assert flat["hw_version"] == ".".join(map(str, said[1:4])) == "4.4.58"
    assert flat["endpoints"]["vbus_voltage"] == {"id": 1, "type": "float", "access": "r"}
    assert flat["endpoints"]["get_adc_voltage"] == {
        "id": 1029,
        "type": "function",
        "inputs": [{"name": "gpio", "type": "uint32"}],
        "outputs": [{"name": "voltage", "type": "float"}],
    }
    numbers = [endpoint["id"] for endpoint in flat["endpoints"].values()]
    assert len(set(numbers)) == len(numbers) == len(ENDPOINTS) + len(FUNCTIONS)


def test_functions_are_called_by_writing_their_arguments_and_answered_with_their_result() -> None:
    (reply,) = call(axis(), "get_adc_voltage", struct.pack("<I", 1))
    assert reply.can_id == f.identifier(NODE, Command.TX_SDO)
    assert struct.unpack("<BHBf", reply.data) == (0, 1029, 0, 0.0)
    assert call(axis(), "get_adc_voltage", b"\1\0") == []
    assert call(axis(), "clear_errors") == []
    (confirmation,) = call(axis(firmware_version=(0, 6, 11)), "clear_errors")
    assert confirmation.data == struct.pack("<BHB4x", 0, 1028, 0)
    assert tell(axis(), Command.RX_SDO, struct.pack("<BHB", 0, 1028, 0)) == []  # it is no value


def test_a_saved_configuration_outlives_the_reboot_and_nothing_is_saved_while_armed() -> None:
    path = "axis0.controller.config.vel_integrator_limit"
    node = axis(boot_ns=SECOND)
    write(node, path, 1.25)
    (reply,) = call(node, "save_configuration")
    assert reply.data[4] == 1
    assert not node.on_frame(f.request(NODE, Command.HEARTBEAT), SECOND - 1)
    assert node.on_frame(f.request(NODE, Command.HEARTBEAT), SECOND)  # booted, before it says so
    assert read(node, path) == 1.25
    arm(node, SECOND)
    assert call(node, "save_configuration", now_ns=SECOND)[0].data[4] == 0


def test_the_integrator_is_held_to_its_limit_and_an_infinite_one_is_none() -> None:
    path = "axis0.controller.config.vel_integrator_limit"
    node = axis(watchdog_ns=0)
    assert read(node, path) == float("inf")
    modes(node, 2)
    arm(node)
    floats(node, Command.SET_VEL_GAINS, 0.0, 1.0)
    floats(node, Command.SET_INPUT_VEL, 1.0, 0.0)
    write(node, path, 0.1)
    for _ in range(400):
        torque = node.torque_demand_shaft(0.001)
    assert torque == pytest.approx(0.1)
    write(node, path, float("inf"))
    for _ in range(100):
        torque = node.torque_demand_shaft(0.001)
    assert torque == pytest.approx(0.2, abs=0.002)
