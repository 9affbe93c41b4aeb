"""CANSimple frames against documented bytes, the vendor's DBC, and hosts' odd lengths."""

from dataclasses import replace
from functools import cache
from importlib import resources

import cantools
import pytest
from cantools.database import Database
from hypothesis import given
from hypothesis import strategies as st
from support import odrive_axis

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.client import OdriveClient
from bridge.drives.odrive.frames import AxisError, Command
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import RTR, Frame
from configs.brief import DriveLink
from configs.sections import PROTOCOL, Mounting

MODEL = replace(odrive_axis.MODEL, torques_period_ns=10_000_000, watchdog_ns=0)
LINK = DriveLink(PROTOCOL.choose({}, ""), True, 0, 1, 1_000_000, Mounting())


@cache
def load_dbc() -> Database:
    text = resources.files("odrive_can").joinpath("dbc/odrive-cansimple-0.6.10.dbc").read_text()
    return cantools.database.load_string(text, "dbc")


@pytest.fixture
def dbc() -> Database:
    return load_dbc()


def decoded(dbc: Database, frame: Frame) -> tuple[str, dict[str, object]]:
    message = dbc.get_message_by_frame_id(frame.can_id & 0x7FF)
    # The DBC gives every message 8 bytes; the vendor's table and hosts use as many as are needed.
    signals = message.decode(frame.data, decode_choices=False, allow_truncated=True)
    return message.name, dict(signals)


@pytest.mark.parametrize(
    ("node", "command", "expected"),
    [(0, Command.HEARTBEAT, 0x001), (1, Command.GET_ENCODER_ESTIMATES, 0x029), (3, 0x0E, 0x06E)],
)
def test_an_identifier_is_node_times_32_plus_command(node, command, expected) -> None:
    assert f.identifier(node, Command(command)) == expected


def test_documented_bytes_of_a_torque_and_of_closed_loop() -> None:
    client = OdriveClient(LINK)
    right, left = client.torque(0.25, -0.5)
    assert right == Frame(0x00E, bytes.fromhex("0000803e"))
    assert left == Frame(0x02E, bytes.fromhex("000000bf"))
    assert f.ONE_U32.pack(f.AxisState.CLOSED_LOOP_CONTROL) == bytes.fromhex("08000000")


@given(st.floats(-1e6, 1e6, width=32), st.floats(-1e3, 1e3, width=32))
def test_the_vendors_dbc_reads_our_encoder_frames(position: float, speed: float) -> None:
    node = OdriveNode(MODEL, 1, 1)
    node.update_encoder(position, speed)
    (_, frame, _) = node.due(0)
    name, signals = decoded(load_dbc(), frame)
    assert name == "Axis1_Get_Encoder_Estimates"
    assert (signals["Pos_Estimate"], signals["Vel_Estimate"]) == (position, speed)


def test_every_cyclic_and_every_requested_frame_is_one_of_the_dbc(dbc) -> None:
    node = OdriveNode(MODEL, 2, 0x1234)
    sent = list(node.due(0))
    for command in Command:
        sent += node.on_frame(Frame(f.identifier(2, command) | RTR, bytes(8)), 0)
    names = {decoded(dbc, frame)[0].removeprefix("Axis2_") for frame in sent}
    assert {
        "Heartbeat",
        "Get_Encoder_Estimates",
        "Get_Torques",
        "Get_Version",
        "Get_Error",
        "Get_Iq",
        "Get_Temperature",
        "Get_Bus_Voltage_Current",
        "Get_Powers",
        "Address",
    } <= names
    for frame in sent:
        message = dbc.get_message_by_frame_id(frame.can_id)
        assert len(frame.data) == message.length, message.name


def test_every_frame_that_the_controller_sends_is_one_of_the_dbc(dbc) -> None:
    client = OdriveClient(LINK)
    drives = [OdriveNode(MODEL, node, node) for node in (0, 1)]
    sent = []
    for now_ns in range(0, 400_000_000, 1_000_000):
        for frame in (frame for drive in drives for frame in drive.due(now_ns)):
            client.on_frame(frame.can_id, frame.data, now_ns)
        said = client.arm(now_ns)
        for frame in said:
            for drive in drives:
                drive.on_frame(frame, now_ns)
        sent += said
    assert client.armed
    sent += [*client.torque(0.1, 0.2), *client.disarm(), *client.estop()]
    names = [decoded(dbc, frame)[0] for frame in sent if frame.data]
    for command in ("Set_Limits", "Set_Controller_Mode", "Set_Axis_State", "Set_Input_Torque"):
        assert f"Axis0_{command}" in names
        assert f"Axis1_{command}" in names
    limits = next(frame for frame in sent if frame.can_id == 0x00F)
    assert decoded(dbc, limits)[1] == {"Velocity_Limit": 10.0, "Current_Limit": 10.0}
    mode = next(frame for frame in sent if frame.can_id == 0x00B)
    assert decoded(dbc, mode)[1] == {"Control_Mode": 1, "Input_Mode": 1}


def test_our_enumerations_are_the_vendors(dbc) -> None:
    heartbeat = dbc.get_message_by_name("Axis0_Heartbeat")
    states = heartbeat.get_signal_by_name("Axis_State").choices
    ours = {"IDLE": 1, "CLOSED_LOOP_CONTROL": 8, "FULL_CALIBRATION_SEQUENCE": 3}
    assert ours.items() <= {str(name): value for value, name in states.items()}.items()
    errors = heartbeat.get_signal_by_name("Axis_Error").choices
    vendor = {str(name): value for value, name in errors.items()}
    for bit in AxisError:
        if bit.name in vendor:
            assert vendor[bit.name] == bit


@given(st.binary(max_size=8))
def test_any_length_reads_as_missing_zeros(data: bytes) -> None:
    assert len(f.padded(data, 8)) == 8
    f.decode_floats(data)
    f.decode_float(data)
    f.decode_heartbeat(data)


def test_error_bits_have_names_and_unknown_ones_numbers() -> None:
    errors = AxisError(0x0100_0000 | 0x0200_0000 | 0x8000_0000)
    assert f.error_names(errors) == "WATCHDOG_TIMER_EXPIRED | ESTOP_REQUESTED | 0x80000000"
