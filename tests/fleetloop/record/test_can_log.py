"""Recordings of a bus, read by python-can's own readers and cut off as a kill would."""

import io
import os
import resource
from pathlib import Path

import can
import numpy as np
import pytest
from can.io.blf import FILE_HEADER_STRUCT
from hypothesis import given
from hypothesis import strategies as st

from bridge.can_bus.pythoncan import to_message
from bridge.frame import EFF, ERR, RTR, Frame
from configs.errors import InfrastructureError
from fleetloop.can.text import compact
from fleetloop.record import candump_log
from fleetloop.record.blf import CONTAINER_FRAMES
from fleetloop.record.can_log import FRAME, FROM_DRIVE, CanLogWriter, Frames, frames_of

ids = st.integers(0, 0x7FF) | st.integers(EFF, EFF | 0x1FFF_FFFF)
data_frames = st.builds(Frame, ids, st.binary(max_size=8))
remote_frames = st.builds(lambda i, n: Frame(i | RTR, bytes(n)), ids, st.integers(0, 8))
error_frames = st.builds(
    Frame, st.integers(ERR, ERR | 0x1FFF_FFFF), st.binary(min_size=8, max_size=8)
)
seconds_100 = st.integers(0, 10**11)
recorded = st.lists(
    st.tuples(seconds_100, data_frames | remote_frames | error_frames, st.booleans()), max_size=30
)
Recorded = list[tuple[int, Frame, bool]]


def block_of(items: Recorded) -> Frames:
    block = np.zeros(len(items), FRAME)
    for row, (stamp_ns, frame, from_drive) in zip(block, items, strict=True):
        data = frame.data
        row["stamp_ns"], row["can_id"], row["length"] = stamp_ns, frame.can_id, len(data)
        row["flags"] = FROM_DRIVE if from_drive else 0
        row["data"][: len(data)] = list(data)
    return block


def regular(count: int) -> Recorded:
    return [
        (k * 250_000, Frame(9 + k % 2, k.to_bytes(8, "little")), k % 2 == 0) for k in range(count)
    ]


def is_read_as(message: can.Message, item: tuple[int, Frame, bool]) -> bool:
    stamp_ns, frame, from_drive = item
    expected = to_message(frame.can_id, frame.data, stamp_ns / 1e9, None, from_drive)
    return message.equals(
        expected,
        timestamp_delta=1e-6,
        check_channel=False,
        check_direction=not message.is_error_frame,
    )


@given(recorded)
def test_python_can_reads_every_kind_of_frame_from_blf(tmp_path_factory, items: Recorded) -> None:
    path = tmp_path_factory.mktemp("log") / "r3.blf"
    with CanLogWriter(path, None, channel=3, name="r3") as writer:
        writer.write(block_of(items).tobytes())
    with can.LogReader(path) as reader:
        assert isinstance(reader, can.BLFReader)
        assert reader.object_count == len(items)
        assert reader.file_size == path.stat().st_size
        heard = list(reader)
    assert len(heard) == len(items)
    for message, item in zip(heard, items, strict=True):
        assert is_read_as(message, item)
        assert message.channel == 2  # python-can counts from 0


@given(recorded)
def test_log_lines_are_candump_s_with_the_direction(items: Recorded) -> None:
    text = candump_log.lines(block_of(items), "r3").decode()
    expected = "".join(
        f"({stamp_ns // 10**9:010}.{stamp_ns % 10**9 // 1000:06}) r3 {compact(frame)}"
        f" {'R' if from_drive else 'T'}\n"
        for stamp_ns, frame, from_drive in items
    )
    assert text == expected


@given(st.lists(st.tuples(seconds_100, data_frames | remote_frames, st.booleans()), max_size=30))
def test_python_can_reads_the_log(items: Recorded) -> None:
    text = candump_log.lines(block_of(items), "r3").decode()
    with can.CanutilsLogReader(io.StringIO(text)) as reader:
        heard = list(reader)
    assert len(heard) == len(items)
    for message, item in zip(heard, items, strict=True):
        assert is_read_as(message, item)
        assert message.channel == "r3"


def test_blocks_of_any_size_leave_all_frames_in_order(tmp_path: Path) -> None:
    items = regular(2 * CONTAINER_FRAMES + 500)
    block = block_of(items)
    paths = tmp_path / "r1.blf", tmp_path / "r1.log"
    with CanLogWriter(*paths, channel=1, name="r1") as writer:
        start = 0
        for size in (1, 7, CONTAINER_FRAMES, 0, 2000, len(block)):
            writer.write(block[start : start + size])
            start += size
    for path in paths:
        with can.LogReader(path) as reader:
            stamps = [round(message.timestamp * 1e9) for message in reader]
        assert stamps == [stamp_ns for stamp_ns, _, _ in items]


def test_a_block_may_be_reused_after_the_call(tmp_path: Path) -> None:
    block = bytearray(block_of(regular(10)).tobytes())
    with CanLogWriter(tmp_path / "r1.blf", tmp_path / "r1.log", channel=1, name="r1") as writer:
        writer.write(memoryview(block))
        block[:] = bytes(len(block))
    with can.LogReader(tmp_path / "r1.blf") as reader:
        assert [is_read_as(*both) for both in zip(reader, regular(10), strict=True)] == [True] * 10


def test_the_same_frames_leave_the_same_bytes_however_they_come_and_are_flushed(
    tmp_path: Path,
) -> None:
    block = block_of(regular(5000))
    for name, step in (("a", 5000), ("b", 700), ("c", CONTAINER_FRAMES)):
        paths = tmp_path / f"{name}.blf", tmp_path / f"{name}.log"
        with CanLogWriter(*paths, channel=1, name="r1") as writer:
            for start in range(0, len(block), step):
                writer.write(block[start : start + step])
                if name != "a":
                    writer.flush()
                    writer.flush()
    for suffix in (".blf", ".log"):
        a, b, c = ((tmp_path / f"{name}{suffix}").read_bytes() for name in "abc")
        assert a == b == c


def test_every_flush_leaves_a_file_that_reads_to_its_end(tmp_path: Path) -> None:
    path, block = tmp_path / "r1.blf", block_of(regular(3 * CONTAINER_FRAMES))
    with CanLogWriter(path, None, channel=1, name="r1") as writer:
        for start in range(0, len(block), 500):
            writer.write(block[start : start + 500])
            writer.flush()
            with can.LogReader(path) as reader:
                assert sum(1 for _ in reader) == min(start + 500, len(block))
                assert reader.object_count == min(start + 500, len(block))
                assert reader.file_size == path.stat().st_size


def test_what_was_flushed_is_readable_while_the_writer_lives_or_dies(tmp_path: Path) -> None:
    writer = CanLogWriter(tmp_path / "r1.blf", tmp_path / "r1.log", channel=1, name="r1")
    writer.write(block_of(regular(5000)))
    writer.flush()
    writer.write(block_of(regular(10)))
    for path in (tmp_path / "r1.blf", tmp_path / "r1.log"):
        with can.LogReader(path) as reader:
            assert sum(1 for _ in reader) == 5000
    header = FILE_HEADER_STRUCT.unpack_from((tmp_path / "r1.blf").read_bytes())
    assert header[10] == (tmp_path / "r1.blf").stat().st_size
    assert header[12] == 5000
    writer.close()


def test_a_file_that_was_cut_in_a_container_reads_up_to_it(tmp_path: Path) -> None:
    path = tmp_path / "r1.blf"
    writer = CanLogWriter(path, None, channel=1, name="r1")
    writer.write(block_of(regular(CONTAINER_FRAMES)))
    complete = path.stat().st_size
    writer.write(block_of(regular(CONTAINER_FRAMES)))
    writer.close()
    os.truncate(path, (complete + path.stat().st_size) // 2)
    with can.LogReader(path) as reader:
        assert sum(1 for _ in reader) >= CONTAINER_FRAMES


def test_nothing_but_whole_records_is_taken() -> None:
    with pytest.raises(ValueError, match="n times 24 bytes, not 25"):
        frames_of(bytes(25))
    with pytest.raises(ValueError, match="not float64"):
        frames_of(np.zeros(3))


def test_lengths_beyond_8_and_times_before_power_up_do_no_harm(tmp_path: Path) -> None:
    block = block_of([(-1, Frame(9, bytes(8)), True)])
    block["length"] = 255
    paths = tmp_path / "r1.blf", tmp_path / "r1.log"
    with CanLogWriter(*paths, channel=1, name="r1") as writer:
        writer.write(block)
    for path in paths:
        with can.LogReader(path) as reader:
            (message,) = reader
        assert (message.timestamp, message.dlc) == (0.0, 8)


def test_a_file_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    missing = tmp_path / "no" / "r1.log"
    with pytest.raises(InfrastructureError, match=r"can't write .*no/r1.log: No such file"):
        CanLogWriter(tmp_path / "r1.blf", missing, channel=1, name="r1")


@pytest.fixture
def small_files():
    import signal

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_leaves_what_was_flushed_of_a_blf_file(tmp_path: Path, small_files) -> None:
    rng = np.random.default_rng(1)  # noise doesn't compress
    path, block = tmp_path / "r1.blf", block_of(regular(20_000))
    block["data"] = rng.integers(0, 256, block["data"].shape)
    writer = CanLogWriter(path, None, channel=1, name="r1")
    flushed = 0
    with pytest.raises(InfrastructureError, match=r"can't write .*r1.blf: File too large"):
        for start in range(0, len(block), 1500):
            writer.write(block[start : start + 1500])
            writer.flush()
            flushed = start + 1500
    assert flushed > 0
    with can.LogReader(path) as reader:
        assert flushed <= sum(1 for _ in reader) < flushed + CONTAINER_FRAMES
    with pytest.raises(InfrastructureError):
        writer.close()


def test_a_full_disk_is_named_and_leaves_what_fitted(tmp_path: Path, small_files) -> None:
    path = tmp_path / "r1.log"
    writer = CanLogWriter(None, path, channel=1, name="r1")
    writer.write(block_of(regular(1000)))
    writer.flush()
    writer.write(block_of(regular(2000)))
    with pytest.raises(InfrastructureError, match=r"can't write .*r1.log: File too large"):
        writer.flush()
    with can.LogReader(path) as reader:
        assert sum(1 for _ in reader) == 1000
    with pytest.raises(InfrastructureError):
        writer.close()
