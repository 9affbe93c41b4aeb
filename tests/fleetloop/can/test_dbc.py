"""The database of emulated drives, read by cantools, against frames of runs and our own decoder."""

import math
import re
import struct
from importlib import resources
from itertools import pairwise
from pathlib import Path

import can
import cantools
import pytest
from cantools.database import Database, Message
from hypothesis import given
from hypothesis import strategies as st

import fleetloop
from bridge.drives.odrive import ODRIVE
from bridge.drives.odrive.decoder import ERRORS, decode
from bridge.drives.odrive.endpoints import ENDPOINTS
from bridge.drives.odrive.frames import AxisError, AxisState, Command
from bridge.drives.odrive.functions import FUNCTIONS
from bridge.frame import RTR, Frame
from configs.errors import ScenarioError
from fleetloop.can.dbc import database, wheels_of, write_dbc

TEXT = database(ODRIVE, {0: ["right wheel"], 1: ["left wheel"], 62: ["a wheel"]})
DBC = cantools.database.load_string(TEXT, "dbc", strict=True)
VENDOR = cantools.database.load_string(
    resources.files("odrive_can").joinpath("dbc/odrive-cansimple-0.6.10.dbc").read_text(), "dbc"
)
SDO = (Command.RX_SDO, Command.TX_SDO)
RESERVED = ("Reserved", "Reserved0", "Reserved1", "Value")


def test_every_message_of_every_node_is_in_it_with_the_vendors_names() -> None:
    assert len(DBC.messages) == 3 * len(Command)
    for theirs in (m for m in VENDOR.messages if m.frame_id < 64):
        ours = DBC.get_message_by_frame_id(theirs.frame_id)
        assert (ours.name, ours.senders) == (theirs.name, theirs.senders)
        assert ours.length <= theirs.length
        if ours.frame_id & 31 not in SDO:
            assert _layout(ours) == _layout(theirs)


def _layout(message: Message) -> dict[str, tuple[int, int, bool, bool, float]]:
    return {
        s.name: (s.start, s.length, s.is_signed and not s.is_float, s.is_float, s.scale)
        for s in message.signals
        if s.name not in RESERVED
    }


@given(st.sampled_from([c for c in Command if c not in SDO]), st.binary(min_size=8, max_size=8))
def test_it_reads_any_data_as_our_decoder_does(command: Command, data: bytes) -> None:
    read = DBC.decode_message(command, data, decode_choices=False)
    said = decode(Frame(command, data)).values
    assert read.keys() == {value.name for value in said}
    words = DBC.decode_message(command, data)
    for name, value, _ in said:
        if isinstance(value, str):
            alone = name not in ERRORS or read[name] in [int(one) for one in AxisError]
            if alone and not value.isdigit() and not value.startswith("0x"):
                assert str(words[name]) == value
        else:
            both_nan = math.isnan(value) and math.isnan(read[name])
            assert both_nan or read[name] == pytest.approx(value)


def test_values_of_endpoints_are_multiplexed_by_their_numbers() -> None:
    answers = DBC.get_message_by_name("Axis1_TxSdo")
    for number, endpoint in ENDPOINTS.items():
        data = bytes([0, number & 0xFF, number >> 8, 0]) + bytes.fromhex("0000803f")
        (name,) = answers.decode(data).keys() - {"Endpoint_ID"}
        signal = answers.get_signal_by_name(name)
        assert signal.comment.startswith(f"{endpoint.path}, read")
        size = struct.calcsize(endpoint.code)
        assert (
            answers.decode(data)[name] == struct.unpack(f"<{endpoint.code}", data[4 : 4 + size])[0]
        )
    calls = DBC.get_message_by_name("Axis1_RxSdo")
    for number, function in FUNCTIONS.items():
        data = bytes([1, number & 0xFF, number >> 8, 0]) + bytes(4)
        (name,) = calls.decode(data).keys() - {"Endpoint_ID", "Opcode"}
        assert name == function.path
    assert str(calls.get_signal_by_name("get_adc_voltage").comment).endswith("(gpio) gives voltage")


def test_states_errors_modes_and_actions_have_words_and_ranges() -> None:
    beat = DBC.get_message_by_name("Axis0_Heartbeat")
    states = beat.get_signal_by_name("Axis_State").choices
    assert {int(n): str(word) for n, word in states.items()} == {int(s): s.name for s in AxisState}
    errors = beat.get_signal_by_name("Axis_Error").choices
    assert (str(errors[0]), str(errors[0x0100_0000])) == ("NO_ERROR", "WATCHDOG_TIMER_EXPIRED")
    reboot = DBC.get_message_by_name("Axis0_Reboot")
    assert reboot.encode({"Action": "SAVE_CONFIGURATION"}) == b"\x01"
    feed = DBC.get_message_by_name("Axis0_Set_Input_Pos").get_signal_by_name("Vel_FF")
    assert (feed.minimum, feed.maximum, feed.unit) == (-32.768, 32.767, "rev/s")
    torque = DBC.get_message_by_name("Axis0_Set_Input_Torque")
    assert torque.encode({"Input_Torque": 0.25}) == bytes.fromhex("0000803e")


def test_it_keeps_to_the_format_for_tools_that_are_stricter() -> None:
    TEXT.encode("ascii")
    names = re.findall(r"^(?:BO_ \d+| SG_) (\w+)", TEXT, re.MULTILINE)
    assert max(map(len, names)) <= 32
    assert all(re.fullmatch(r"[A-Za-z_]\w*", name) for name in names)
    order = ["VERSION", "NS_ :", "BS_:", "BU_:", "BO_ ", "CM_ ", "BA_DEF_ ", "BA_ ", "VAL_ "]
    places = [TEXT.index(f"\n{word}" if n else word) for n, word in enumerate(order)]
    assert all(one < other for one, other in pairwise([*places, TEXT.index("\nSIG_VALTYPE_ ")]))
    for message in DBC.messages:
        assert len({signal.name for signal in message.signals}) == len(message.signals)


def test_recorded_traffic_of_a_run_is_read_as_our_decoder_reads_it(tmp_path: Path) -> None:
    everything = dict.fromkeys(("iq", "temperature", "bus_voltage", "error", "torques"), 0.05)
    scenario = fleetloop.load("realistic").with_(
        drive={f"{name}_period_s": period_s for name, period_s in everything.items()},
        until_s=0.3,
        expect=None,
    )
    run = fleetloop.run(scenario, out=tmp_path / "run", force=True)
    assert write_dbc(str(run.folder), tmp_path / "drives.dbc", bus="r2") == 0
    dbc: Database = cantools.database.load_file(tmp_path / "drives.dbc", strict=True)
    seen = set()
    for frame in can.BLFReader(run.folder / "can" / "r2.blf"):
        ours = decode(Frame(frame.arbitration_id | RTR * frame.is_remote_frame, frame.data))
        if frame.is_remote_frame or ours.request:
            continue
        read = dbc.decode_message(
            frame.arbitration_id, frame.data, decode_choices=False, allow_truncated=True
        )
        numbers = {name: value for name, value, _ in ours.values if not isinstance(value, str)}
        assert {name: read[name] for name in numbers} == pytest.approx(numbers, nan_ok=True)
        seen.add(ours.name)
    assert {"Heartbeat", "Get_Iq", "Get_Encoder_Estimates", "Set_Input_Torque"} <= seen
    assert len(seen) >= 9


def test_nodes_are_those_of_the_scenario_or_of_one_bus(capsys: pytest.CaptureFixture[str]) -> None:
    two = fleetloop.load("two_robots").with_(
        robot={"r1": {"bus": "shared"}, "r2": {"bus": "shared"}}
    )
    assert wheels_of(two) == {
        0: ["r1: right wheel"],
        1: ["r1: left wheel"],
        2: ["r2: right wheel"],
        3: ["r2: left wheel"],
    }
    assert wheels_of(fleetloop.load("two_robots"))[0] == ["r1: right wheel", "r2: right wheel"]
    assert write_dbc("two_robots", None) == 0
    printed = cantools.database.load_string(capsys.readouterr().out, "dbc")
    assert printed.get_node_by_name("ODrive_Axis1").comment == "r1: left wheel; r2: left wheel"


@pytest.mark.parametrize(
    ("source", "options", "text"),
    [
        ("two_robots", {"bus": "r9"}, "--bus r9: two_robots has no such bus; there are r1, r2"),
        (None, {"bus": "r1"}, "--bus r1: name the scenario"),
        ("two_robots", {"protocol_name": "odrive"}, "--protocol odrive: two_robots says itself"),
        ("nowhere/record.mcap", {}, "nowhere/record.mcap: no record.mcap there"),
    ],
)
def test_what_is_not_there_is_said(source: str, options: dict[str, str], text: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        write_dbc(source, None, **options)
    assert text in str(caught.value)


def test_a_protocol_without_a_description_is_refused() -> None:
    with pytest.raises(ScenarioError, match="does not describe its frames"):
        database(ODRIVE._replace(formats=None), {0: []})
