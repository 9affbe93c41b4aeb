"""Damaged and cut records: refused by name, or read up to there with a word; no other numbers."""

import itertools
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap import records
from mcap.opcode import Opcode
from mcap.writer import Writer
from support.controller_rows import SIGNALS

from configs.brief import Drawing, DrawnRobot
from configs.events import Event
from configs.paths import Circle, World
from fleetloop.record.events import add_events
from fleetloop.record.head import MAGIC, build, encoded
from fleetloop.record.reader import Record
from fleetloop.record.scan import RecordError
from fleetloop.record.schema import Layout
from fleetloop.record.writer import CHUNK_TICKS, RecordWriter, finish_truncated

ROBOTS = ("r1", "r2")
TICKS = 2 * CHUNK_TICKS + 100
SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


class Piece(NamedTuple):
    """A record of the file."""

    opcode: int
    start: int
    end: int


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("damage") / "whole.mcap", TICKS)


def write(path: Path, ticks: int) -> Path:
    """A record with messages on every channel."""
    draw = np.random.default_rng(1)
    circle = DrawnRobot(
        path=(Circle(kind="circle", radius_m=2.0), World(kind="world", x_m=1.0)), s_span=(0.0, 3.0)
    )
    drawing = Drawing((circle,) * len(ROBOTS), (("r1", "r2", None),))
    layout = dict.fromkeys(ROBOTS, SIGNALS)
    with RecordWriter(path, layout, 'name = "x"\n', 1_000_000, drawing=drawing) as writer:
        for robot in ROBOTS:
            for source, width in (("plant", 12), ("controller", 35)):
                rows = draw.normal(size=(ticks, width)).round(2)
                writer.add(robot, source, 0, rows.tobytes())
    add_events(Record.open(path), [Event(1, "r1", "stopped"), Event(1, "r2", "left")], 1_000_000)
    return path


@pytest.fixture(scope="module")
def truth(whole: Path) -> Record:
    return Record.open(whole)


def pieces(content: bytes) -> list[Piece]:
    found, at = [], len(MAGIC)
    while at < len(content) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", content, at)
        found.append(Piece(opcode, at, at + 9 + length))
        at += 9 + length
    return found


def chunks(content: bytes) -> list[bytes]:
    """Every chunk with its index."""
    found = pieces(content)
    return [
        content[piece.start : index.end]
        for piece, index in itertools.pairwise(found)
        if piece.opcode == Opcode.CHUNK
    ]


def check(path: Path, content: bytes, truth: Record) -> str:
    """What is said of a file with this content; nothing but right rows may come out of it."""
    path.write_bytes(content)
    words = set()
    for damaged in (False, True):
        try:
            record = Record.open(path, damaged=damaged)
        except RecordError as error:
            assert str(error).startswith(f"{path}: ")
            assert "\n" not in str(error)
            words.add(str(error))
            continue
        assert record.lost, "it is not what was written, and nothing was said"
        assert record.robots == truth.robots
        assert record.scenario_toml == truth.scenario_toml
        for robot in ROBOTS:
            for mine, right in ((record.plant, truth.plant), (record.controller, truth.controller)):
                assert mine[robot].tobytes() == right[robot][: len(mine[robot])].tobytes()
        words.add(record.lost)
    return "; ".join(words)


@SHARED
@given(st.data())
def test_no_flipped_bit_passes(whole: Path, truth: Record, tmp_path: Path, data) -> None:
    content = bytearray(whole.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    check(tmp_path / "a.mcap", content, truth)


@SHARED
@given(st.data())
def test_no_flipped_bit_passes_in_a_file_without_its_end(
    whole: Path, truth: Record, tmp_path: Path, data
) -> None:
    content = bytearray(whole.read_bytes())
    del content[data.draw(st.integers(1, len(content) - 1)) :]
    content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    check(tmp_path / "a.mcap", content, truth)


@SHARED
@given(st.data())
def test_no_overwritten_stretch_passes(whole: Path, truth: Record, tmp_path: Path, data) -> None:
    content = bytearray(whole.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    length = min(data.draw(st.sampled_from([1, 8, 512, 4096])), len(content) - at)
    filler = data.draw(st.sampled_from([bytes(length), b"\xff" * length, content[:length]]))
    if content[at : at + length] == filler:
        return
    content[at : at + length] = filler
    check(tmp_path / "a.mcap", content, truth)


def test_a_flipped_bit_is_seen_wherever_it_is(tmp_path: Path) -> None:
    content = write(tmp_path / "whole.mcap", 2).read_bytes()
    truth = Record.open(tmp_path / "whole.mcap")
    for at in range(0, len(content), 31):
        hurt = bytearray(content)
        hurt[at] ^= 1 << (at % 8)
        check(tmp_path / "a.mcap", hurt, truth)


def test_a_file_cut_at_any_border_says_so_and_gives_what_is_before(tmp_path: Path) -> None:
    content = write(tmp_path / "whole.mcap", CHUNK_TICKS + 1).read_bytes()
    truth = Record.open(tmp_path / "whole.mcap")
    for piece in pieces(content):
        for at in (piece.start, piece.start + 9, piece.end - 1):
            assert f"cut at byte {at}" in check(tmp_path / "a.mcap", content[:at], truth)


def test_zeros_to_the_end_are_a_cut(whole: Path, truth: Record, tmp_path: Path) -> None:
    content = whole.read_bytes()
    at = next(it.start for it in pieces(content)[30:] if it.opcode == Opcode.CHUNK)
    word = check(tmp_path / "a.mcap", content[:at] + bytes(len(content) - at), truth)
    assert f"cut at byte {at}, only zeros follow" in word


@pytest.mark.parametrize("kept", ["end", "no end"])
def test_chunks_that_are_swapped_doubled_or_missing_are_damage(
    whole: Path, truth: Record, tmp_path: Path, kept: str
) -> None:
    content = whole.read_bytes()
    found = chunks(content)
    start = content.index(found[0])
    end = content[start + sum(map(len, found)) :] if kept == "end" else b""
    # Of each robot rows, poses, rows, three times; then six views, then events.
    first, second, rest = found[:6], found[6:12], found[12:]
    assert len(rest) == 6 + 6 + 1
    for other in (
        second + first + rest,
        found[:1] + found,
        second + rest,
        first + rest,
        [*first, *second, *rest, rest[-2]],
        [*first, *second, *rest, rest[-1]],
    ):
        body = content[:start] + b"".join(other)
        assert "damaged at byte" in check(tmp_path / "a.mcap", body + end, truth)


def test_what_was_damaged_is_named_with_its_place(whole: Path, tmp_path: Path) -> None:
    content = whole.read_bytes()
    chunk = next(piece for piece in pieces(content) if piece.opcode == Opcode.CHUNK)
    hurt = bytearray(content)
    hurt[chunk.end - 500] ^= 0x10
    (tmp_path / "a.mcap").write_bytes(hurt)
    with pytest.raises(RecordError, match=rf"a\.mcap: damaged at byte {chunk.start}: .* chunk"):
        Record.open(tmp_path / "a.mcap")


def test_bytes_behind_the_end_are_damage(whole: Path, truth: Record, tmp_path: Path) -> None:
    content = whole.read_bytes()
    for more in (b"\0", MAGIC, content):
        assert "damaged at byte" in check(tmp_path / "a.mcap", content + more, truth)


def test_a_damaged_file_is_not_completed_as_if_it_were_cut(whole: Path, tmp_path: Path) -> None:
    content = bytearray(whole.read_bytes())
    content[pieces(content)[-1].start - 40_000] ^= 1
    (tmp_path / "a.mcap").write_bytes(content[:-100])
    before = (tmp_path / "a.mcap").read_bytes()
    with pytest.raises(RecordError, match="damaged at byte"):
        finish_truncated(tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == before


def test_a_record_of_other_signals_names_them(tmp_path: Path) -> None:
    head = build(Layout.of(dict.fromkeys(ROBOTS, SIGNALS)), "")
    before = head.data[: head.metadata.offset].replace(b"float64 kappa_hat", b"float64 gamma_hat")
    facts = {"version": "9.9", "crc32_of_all_before": f"{zlib.crc32(before):08x}"}
    (tmp_path / "a.mcap").write_bytes(before + encoded(records.Metadata("fleetloop", facts)))
    with pytest.raises(
        RecordError, match=r"written by Fleetloop 9\.9 in another layout.*gamma_hat, kappa_hat"
    ):
        Record.open(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty, not a record"),
        (b"no such thing", "not an MCAP file"),
        (b"\x89PNG", "cut at byte 4, before the first row"),
        (MAGIC, "cut at byte 8, before the first row"),
        (MAGIC + bytes(5000), "only zeros follow, before the first row"),
        (MAGIC + MAGIC * 100, "damaged"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(RecordError, match=message):
        Record.open(tmp_path / "a.mcap")


def test_a_record_of_somebody_else_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="rosbag2")
        writer.finish()
    with pytest.raises(RecordError, match=r"not the record of a run, but of 'rosbag2'"):
        Record.open(tmp_path / "a.mcap")
