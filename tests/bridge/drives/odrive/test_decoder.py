"""Words for CANSimple frames against the vendor's database, read by cantools."""

import math
from importlib import resources

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.drives.odrive.decoder import decode, words
from bridge.drives.odrive.frames import Command
from bridge.frame import EFF, ERR, RTR, Frame

DBC = cantools.database.load_string(
    resources.files("odrive_can").joinpath("dbc/odrive-cansimple-0.6.10.dbc").read_text(), "dbc"
)


@pytest.mark.parametrize("command", list(Command))
def test_names_are_the_vendor_s(command: Command) -> None:
    message = decode(Frame(command, bytes(8)))
    known = DBC.get_message_by_frame_id(command)
    assert message.name == known.name.removeprefix("Axis0_")
    reserved = ("Reserved", "Reserved0", "Reserved1")
    assert {value.name for value in message.values} == {
        signal.name for signal in known.signals if signal.name not in reserved
    }


@given(st.sampled_from(list(Command)), st.binary(min_size=8, max_size=8))
def test_numbers_are_those_that_cantools_reads(command: Command, data: bytes) -> None:
    theirs = DBC.get_message_by_frame_id(command).decode(
        data, decode_choices=False, allow_truncated=True
    )
    for name, value, _ in decode(Frame(command, data)).values:
        if not isinstance(value, str):
            both_nan = math.isnan(value) and math.isnan(theirs[name])
            assert both_nan or value == pytest.approx(theirs[name])


def test_states_and_errors_have_names() -> None:
    heartbeat = Frame(0x021, bytes.fromhex("0000000108 00 01 00"))
    assert words(heartbeat) == (
        "node  1  Heartbeat  Axis_Error=WATCHDOG_TIMER_EXPIRED  Axis_State=CLOSED_LOOP_CONTROL"
        "  Procedure_Result=SUCCESS  Trajectory_Done_Flag=1"
    )


def test_a_setpoint_has_its_unit() -> None:
    assert words(Frame(0x00E, bytes.fromhex("0000803E"))) == (
        "node  0  Set_Input_Torque  Input_Torque=0.25 N·m"
    )


@pytest.mark.parametrize("frame", [Frame(0x017 | RTR, bytes(8)), Frame(0x017, b"")])
def test_a_remote_or_empty_frame_of_what_a_drive_says_is_a_request(frame: Frame) -> None:
    assert words(frame) == "node  0  Get_Bus_Voltage_Current  request"


def test_an_empty_command_is_no_request() -> None:
    assert words(Frame(0x002, b"")) == "node  0  Estop"


@pytest.mark.parametrize("can_id", [EFF | 0x009, ERR | 0x040, 0x01E, 0x008])
def test_what_is_not_cansimple_has_no_words(can_id: int) -> None:
    assert words(Frame(can_id, bytes(8))) == ""


@given(st.integers(0, 0xFFFF_FFFF), st.binary(max_size=8))
def test_no_frame_can_raise(can_id: int, data: bytes) -> None:
    words(Frame(can_id, data))
