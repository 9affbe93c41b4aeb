"""Arming, calibration, reboot, addressing and cyclic messages of an axis."""

import pytest
from support.odrive_axis import (
    MODEL,
    MS,
    NODE,
    SERIAL_NUMBER,
    arm,
    ask_state,
    axis,
    beat,
    floats,
    read,
    tell,
    torque,
)

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ProcedureResult
from bridge.drives.odrive.node import ANSWER_WITHIN_NS, OdriveNode
from bridge.frame import Frame

SECOND = 1000 * MS


def told(node: OdriveNode, serial: int, node_id: int, length: int = 8) -> None:
    data = (bytes((node_id,)) + serial.to_bytes(6, "little") + b"\0")[:length]
    node.on_frame(Frame(f.identifier(f.UNADDRESSED, Command.ADDRESS), data), 0)


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
    assert reply.data == b"\x3f" + SERIAL_NUMBER.to_bytes(6, "little") + b"\0"
    assert not node.due(at_ns + SECOND)
    told(node, SERIAL_NUMBER, 5)
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
    told(node, SERIAL_NUMBER, 9, length)
    assert node.node_id == NODE


def test_an_address_of_seven_bytes_a_foreign_one_and_one_out_of_range() -> None:
    node = axis()
    told(node, 77, 9)
    assert node.node_id == NODE
    told(node, SERIAL_NUMBER, 64)
    assert node.node_id == NODE
    told(node, SERIAL_NUMBER, 9, 7)
    assert (node.node_id, node.setpoint_id) == (9, 0x12E)
    told(node, 0, 10)
    assert node.node_id == 10


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
