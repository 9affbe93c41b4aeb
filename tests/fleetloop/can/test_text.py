"""Frames as text against can-utils' documentation (`lib.h`) and other people's readers."""

import io
import shutil
import subprocess

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.can_bus.pythoncan import to_message
from bridge.frame import EFF, ERR, RTR, Frame
from configs.errors import ScenarioError
from fleetloop.can.text import compact, long, long_columns, parse

data = st.binary(max_size=8)
lengths = st.integers(0, 8).map(bytes)
plain = st.integers(0, 0x7FF)
wide = st.integers(0, 0x1FFF_FFFF).map(lambda number: number | EFF)
data_frames = st.builds(Frame, plain | wide, data)
remote_frames = st.builds(Frame, (plain | wide).map(lambda can_id: can_id | RTR), lengths)
error_frames = st.builds(Frame, st.integers(0, 0x1FFF_FFFF).map(lambda bits: bits | ERR), data)
frames = data_frames | remote_frames | error_frames


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        ("123#", Frame(0x123, b"")),
        ("12345678#", Frame(0x12345678 | EFF, b"")),
        ("123#R", Frame(0x123 | RTR, b"")),
        ("123#R0", Frame(0x123 | RTR, b"")),
        ("123#R7", Frame(0x123 | RTR, bytes(7))),
        ("7A1#r", Frame(0x7A1 | RTR, b"")),
        ("00000123#R3", Frame(0x123 | EFF | RTR, bytes(3))),
        ("123#00", Frame(0x123, b"\0")),
        ("123#1122334455667788", Frame(0x123, bytes.fromhex("1122334455667788"))),
        ("123#11.22.33.44.55.66.77.88", Frame(0x123, bytes.fromhex("1122334455667788"))),
        ("5A1#11.2233.44556677.88", Frame(0x5A1, bytes.fromhex("1122334455667788"))),
        ("1F334455#11.22", Frame(0x1F334455 | EFF, b"\x11\x22")),
        ("32345678#112233", Frame(0x32345678, b"\x11\x22\x33")),
        ("123#deadBEEF", Frame(0x123, b"\xde\xad\xbe\xef")),
    ],
)
def test_cansend_s_documented_forms_mean_their_frames(text: str, frame: Frame) -> None:
    assert parse(text) == frame


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no '#'"),
        ("123", "no '#'"),
        ("12#00", "3 (11-bit) or 8 (29-bit)"),
        ("800#00", "largest 11-bit identifier is 7FF"),
        ("xyz#00", "hex digits"),
        ("40000000#00", "largest 29-bit identifier is 1FFFFFFF"),
        ("123#0", "pairs of hex digits"),
        ("123#0g", "pairs of hex digits"),
        ("123#00 ", "pairs of hex digits"),
        ("123#00.", "pairs of hex digits"),
        ("123#112233445566778899", "9 bytes"),
        ("123#R9", "0 to 8"),
        ("123#R8_9", "raw length code"),
        ("123##100", "CAN FD"),
        ("45123#81:00:12345678#11", "3 (11-bit) or 8 (29-bit)"),
        ("20000001#R", "can't be remote"),
    ],
)
def test_what_is_no_classic_frame_is_refused_with_the_reason(text: str, complaint: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse(text)
    assert complaint in str(caught.value)
    assert "123#DEADBEEF" in str(caught.value)


@given(frames)
def test_what_is_printed_compactly_reads_back(frame: Frame) -> None:
    assert parse(compact(frame)) == frame


@given(st.text(max_size=30) | st.from_regex(r"[0-9A-F]{3}#[0-9A-FRr.#_]{0,20}", fullmatch=True))
def test_any_text_is_a_frame_or_refused(text: str) -> None:
    try:
        frame = parse(text)
    except ScenarioError:
        return
    assert len(frame.data) <= 8


@pytest.mark.parametrize(
    ("frame", "line"),
    [
        (Frame(0x123, b"\x11\x22\x33"), "123   [3]  11 22 33"),
        (Frame(0x12345678 | EFF, b"\x11\x22\x33"), "12345678   [3]  11 22 33"),
        (Frame(0x12345678 | EFF | RTR, b""), "12345678   [0]  remote request"),
        (Frame(0x123 | RTR, bytes(8)), "123   [8]  remote request"),
        (
            Frame(0x20001111, bytes.fromhex("C6237B3269983C")),
            "20001111   [7]  C6 23 7B 32 69 98 3C      ERRORFRAME",
        ),
        (Frame(0x123, b""), "123   [0] "),
    ],
)
def test_long_lines_are_those_that_lib_h_documents(frame: Frame, line: str) -> None:
    assert long(frame) == line


def test_ascii_is_appended_and_short_identifiers_are_indented_as_documented() -> None:
    named = Frame(0x14B0DC51 | EFF, bytes.fromhex("4A94E82AEC585562"))
    assert long(named, ascii_too=True) == ("14B0DC51   [8]  4A 94 E8 2A EC 58 55 62   'J..*.XUb'")
    assert long(Frame(0x123, b"\x11\x22\x33"), indent=True) == "     123   [3]  11 22 33"


@given(data_frames | remote_frames)
def test_no_line_is_longer_than_the_column_where_words_begin(frame: Frame) -> None:
    assert len(long(frame, indent=True)) <= long_columns(indent=True)


@given(st.lists(data_frames | remote_frames, min_size=1, max_size=5))
def test_python_can_s_reader_reads_compact_lines(sent: list[Frame]) -> None:
    log = "".join(f"(0000000001.000000) r1 {compact(frame)}\n" for frame in sent)
    with can.CanutilsLogReader(io.StringIO(log)) as reader:
        heard = list(reader)
    for frame, message in zip(sent, heard, strict=True):
        expected = to_message(frame.can_id, frame.data)
        assert message.equals(
            expected, timestamp_delta=None, check_channel=False, check_direction=False
        )


@pytest.mark.skipif(shutil.which("log2long") is None, reason="needs can-utils")
@given(st.lists(frames, min_size=1, max_size=20))
def test_can_utils_own_converter_prints_the_same_lines(sent: list[Frame]) -> None:
    log = "".join(f"(0000000001.000000) can0 {compact(frame)}\n" for frame in sent)
    done = subprocess.run(["log2long"], input=log, capture_output=True, text=True, check=True)
    printed = done.stdout.splitlines()
    for frame, line in zip(sent, printed, strict=True):
        ours = long(frame, indent=True, ascii_too=True)
        assert line == f"(0000000001.000000)  can0  {ours}"
