"""Arming, calibration, reboot, addressing and endpoints of an axis."""

import struct

import pytest
from support.odrive_axis import (
    MODEL,
    MS,
    NODE,
    arm,
    ask_state,
    axis,
    beat,
    floats,
    modes,
    tell,
    torque,
)

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.endpoints import ENDPOINTS, flat_endpoints
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ProcedureResult
from bridge.drives.odrive.functions import FUNCTIONS
from bridge.drives.odrive.node import ANSWER_WITHIN_NS, OdriveNode
from bridge.frame import RTR, Frame

SECOND = 1000 * MS
NUMBER = {endpoint.path: endpoint.number for endpoint in ENDPOINTS.values()}


def told(node: OdriveNode, serial: int, node_id: int, length: int = 8) -> None:
    data = (bytes((node_id,)) + serial.to_bytes(6, "little") + b"\0")[:length]
    node.on_frame(Frame(f.identifier(f.UNADDRESSED, Command.ADDRESS), data), 0)


def read(node: OdriveNode, path: str, code: str = "f") -> float:
    (reply,) = tell(node, Command.RX_SDO, struct.pack("<BHBI", 0, NUMBER[path], 0, 0))
    assert reply.can_id == f.identifier(NODE, Command.TX_SDO)
    assert struct.unpack_from("<BHB", reply.data) == (0, NUMBER[path], 0)
    return struct.unpack_from(f"<{code}", reply.data, 4)[0]


def write(node: OdriveNode, path: str, value: float, code: str = "f") -> list[Frame]:
    data = struct.pack(f"<BHB{code}", 1, NUMBER[path], 0, value)
    return tell(node, Command.RX_SDO, data)


# --- calibration ---------------------------------------------------------------------------------


def test_an_axis_that_is_not_calibrated_does_not_arm_and_says_why() -> None:
    node = axis(calibrated=False)
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL)
    assert beat(node)[:3] == (AxisError(0), AxisState.IDLE, ProcedureResult.NOT_CALIBRATED)


def test_a_full_calibration_takes_its_time_and_then_the_axis_arms() -> None:
    node = axis(calibrated=False, calibration_ns=2 * SECOND)
    ask_state(node, AxisState.FULL_CALIBRATION_SEQUENCE)
    seen = []
    for t in (0, 2 * SECOND - 1, 2 * SECOND, 4 * SECOND - 1, 4 * SECOND):
        node.due(t)
        seen.append((node.state.value, node.result.value))
    assert seen == [(4, 1), (4, 1), (7, 1), (7, 1), (1, 0)]
    arm(node, 5 * SECOND)


def test_the_end_of_a_calibration_is_a_time_at_which_something_is_due() -> None:
    node = axis(calibration_ns=1_234_567, heartbeat_period_ns=0, encoder_period_ns=0)
    node.due(0)
    ask_state(node, AxisState.MOTOR_CALIBRATION)
    assert node.next_due_ns == 1_234_567


def test_an_encoder_offset_needs_a_calibrated_motor() -> None:
    node = axis(calibrated=False)
    ask_state(node, AxisState.ENCODER_OFFSET_CALIBRATION)
    assert beat(node).result == ProcedureResult.NOT_CALIBRATED


def test_a_calibration_is_cancelled_by_idle_and_disarmed_by_an_emergency_stop() -> None:
    node = axis()
    ask_state(node, AxisState.MOTOR_CALIBRATION)
    ask_state(node, AxisState.IDLE)
    assert beat(node).result == ProcedureResult.CANCELLED
    ask_state(node, AxisState.MOTOR_CALIBRATION)
    tell(node, Command.ESTOP)
    assert beat(node)[:3] == (AxisError.ESTOP_REQUESTED, AxisState.IDLE, ProcedureResult.DISARMED)


def test_calibration_makes_no_torque() -> None:
    node = axis()
    torque(node, 0.3)
    ask_state(node, AxisState.FULL_CALIBRATION_SEQUENCE)
    assert node.torque_demand_shaft(0.001) == 0.0


@pytest.mark.parametrize("state", [5, 9, 10, 12, 13, 14, 15, 0xFFFF_FFFF])
def test_procedures_that_do_not_exist_end_in_idle_as_invalid(state: int) -> None:
    node = arm(axis())
    ask_state(node, state)
    assert beat(node)[:3] == (AxisError(0), AxisState.IDLE, ProcedureResult.INVALID_STATE)


def test_homing_without_an_endstop_says_so() -> None:
    node = axis()
    ask_state(node, AxisState.HOMING)
    assert beat(node).result == ProcedureResult.HOMING_WITHOUT_ENDSTOP


def test_state_0_asks_for_nothing() -> None:
    node = arm(axis())
    ask_state(node, 0)
    assert node.state is AxisState.CLOSED_LOOP_CONTROL


# --- reboot --------------------------------------------------------------------------------------


def test_a_reboot_is_silent_for_a_while_and_forgets_what_was_not_saved() -> None:
    node = axis(boot_ns=500 * MS)
    node.due(0)
    floats(node, Command.SET_LIMITS, 2.0, 3.0)
    tell(node, Command.REBOOT, b"\0", 10 * MS)
    assert node.next_due_ns == 510 * MS
    assert not node.due(509 * MS)
    assert not node.on_frame(f.request(NODE, Command.HEARTBEAT), 509 * MS)
    assert [frame.can_id & 0x1F for frame in node.due(510 * MS)] == [1, 9]
    assert read(node, "axis0.controller.config.vel_limit") == 10.0


def test_what_was_saved_outlives_a_reboot_and_erasing_brings_back_the_delivered() -> None:
    node = axis(calibrated=False, calibration_ns=1)
    ask_state(node, AxisState.FULL_CALIBRATION_SEQUENCE)
    node.due(10)
    floats(node, Command.SET_LIMITS, 2.0, 3.0)
    tell(node, Command.REBOOT, b"\1", 20)
    assert read(node, "axis0.controller.config.vel_limit") == 2.0
    arm(node)
    ask_state(node, AxisState.IDLE)
    tell(node, Command.REBOOT, b"\2", 30)
    assert read(node, "axis0.controller.config.vel_limit") == 10.0
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL)
    assert beat(node).result == ProcedureResult.NOT_CALIBRATED


@pytest.mark.parametrize("action", [b"\0", b"\1", b"\2", b"\3", b""])
def test_no_reboot_while_armed(action: bytes) -> None:
    node = arm(axis())
    tell(node, Command.REBOOT, action)
    tell(node, Command.ENTER_DFU_MODE)
    assert beat(node).state == AxisState.CLOSED_LOOP_CONTROL


@pytest.mark.parametrize(("command", "data"), [(Command.REBOOT, b"\3"), (0x1F, b"")])
def test_dfu_mode_is_the_end_of_it(command: int, data: bytes) -> None:
    node = axis()
    tell(node, Command(command), data)
    assert not node.due(3600 * SECOND)
    assert not node.on_frame(f.request(NODE, Command.HEARTBEAT), 3600 * SECOND)


# --- address -------------------------------------------------------------------------------------


def test_an_unaddressed_drive_is_silent_but_answers_for_its_address_after_a_while() -> None:
    node = axis()
    told(node, 1, NODE)
    assert node.node_id == f.UNADDRESSED
    assert not node.due(SECOND)
    torque(node, 0.2)
    assert node.input_torque_shaft == 0.0
    assert not node.on_frame(f.request(f.UNADDRESSED, Command.ADDRESS), SECOND)
    at_ns = node.next_due_ns
    assert SECOND < at_ns <= SECOND + ANSWER_WITHIN_NS
    (reply,) = node.due(at_ns)
    assert reply.can_id == f.identifier(f.UNADDRESSED, Command.ADDRESS)
    assert reply.data == b"\x3f" + MODEL.serial_number.to_bytes(6, "little") + b"\0"
    assert not node.due(at_ns + SECOND)
    told(node, MODEL.serial_number, 5)
    assert [frame.can_id for frame in node.due(at_ns + SECOND)] == [0x0A1, 0x0A9]


def test_unaddressed_drives_answer_at_different_times() -> None:
    at = set()
    for serial in range(20):
        node = OdriveNode(MODEL, f.UNADDRESSED, serial)
        node.on_frame(f.request(f.UNADDRESSED, Command.ADDRESS), 0)
        at.add(node.next_due_ns)
    assert len(at) > 15


@pytest.mark.parametrize("length", [1, 2, 6])
def test_a_short_address_is_ignored(length: int) -> None:
    node = axis()
    told(node, MODEL.serial_number, 9, length)
    assert node.node_id == NODE


def test_an_address_of_seven_bytes_a_foreign_one_and_one_out_of_range() -> None:
    node = axis()
    told(node, 77, 9)
    assert node.node_id == NODE
    told(node, MODEL.serial_number, 64)
    assert node.node_id == NODE
    told(node, MODEL.serial_number, 9, 7)
    assert (node.node_id, node.setpoint_id) == (9, 0x12E)
    told(node, 0, 10)
    assert node.node_id == 10


# --- endpoints -----------------------------------------------------------------------------------


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


def call(node: OdriveNode, path: str, argument: bytes = b"", now_ns: int = 0) -> list[Frame]:
    number = next(n for n, function in FUNCTIONS.items() if function.path == path)
    return tell(node, Command.RX_SDO, struct.pack("<BHB", 1, number, 0) + argument, now_ns)


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


# --- cyclic messages -----------------------------------------------------------------------------


def test_every_cyclic_message_has_its_period() -> None:
    node = axis(
        heartbeat_period_ns=100 * MS,
        encoder_period_ns=10 * MS,
        error_period_ns=50 * MS,
        iq_period_ns=20 * MS,
        temperature_period_ns=100 * MS,
        bus_voltage_period_ns=25 * MS,
        torques_period_ns=5 * MS,
        powers_period_ns=200 * MS,
    )
    counts = dict.fromkeys(range(32), 0)
    for t in range(200):
        sent = [frame.can_id & 0x1F for frame in node.due(t * MS)]
        assert sent == sorted(sent)
        for command in sent:
            counts[command] += 1
    assert {c: n for c, n in counts.items() if n} == {
        0x01: 2, 0x03: 4, 0x09: 20, 0x14: 10, 0x15: 2, 0x17: 8, 0x1C: 40, 0x1D: 1
    }  # fmt: skip
