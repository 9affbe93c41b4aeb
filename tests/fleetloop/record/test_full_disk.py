"""A disk that becomes full, a file that may not grow: what was recorded ends well and says why."""

import contextlib
import resource
import subprocess
from collections.abc import Iterator
from pathlib import Path

import can
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from support.controller_rows import SIGNALS

from configs.errors import InfrastructureError
from configs.events import Event
from fleetloop.record.append import AppendedFile
from fleetloop.record.can_log import FRAME, CanLogWriter
from fleetloop.record.events import add_events
from fleetloop.record.reader import Record
from fleetloop.record.run_record import RunRecord
from fleetloop.record.writer import RecordWriter

DISK_BYTES = 1 << 20
ROWS = {
    source: np.random.default_rng(width).normal(size=(512, width)).tobytes()
    for source, width in (("plant", 12), ("controller", 35))
}


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own of 1 MiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", disk]
    with contextlib.suppress(OSError):
        if subprocess.run(mount, capture_output=True, timeout=10).returncode == 0:
            yield disk
            subprocess.run(["umount", "-l", disk], check=True, timeout=10)
            return
    pytest.skip("this user may not mount a file system")


@contextlib.contextmanager
def largest_file(size: int) -> Iterator[None]:
    """No file of this process may become larger; space can be reserved, and isn't there."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def fill(disk: Path) -> None:
    with (disk / "others").open("ab", buffering=0) as stream, contextlib.suppress(OSError):
        while stream.write(bytes(4096)):
            pass


def record(path: Path, groups: int, before: int = 0, meanwhile=lambda: None) -> None:
    """Write so many groups of rows; after `before` of them something else happens."""
    with RecordWriter(path, {"r1": SIGNALS}, 'name = "x"\n', 1_000_000) as writer:
        for group in range(groups):
            if group == before:
                meanwhile()
            for source, rows in ROWS.items():
                writer.add("r1", source, 512 * group, rows)


def check_it_ends_well(path: Path, why: str) -> Record:
    """Tools that we did not write take it as whole; ours says what happened."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        count = reader.get_summary().statistics.message_count
        assert sum(1 for _ in reader.iter_messages()) == count
        assert [item.metadata for item in reader.iter_metadata()][-1]["lost"]
        stream.seek(0)
        assert list(StreamReader(stream, validate_crcs=True).records)
    found = Record.open(path)
    assert why in found.lost
    rows = found.controller["r1"]
    assert rows["tick"].tolist() == list(range(len(rows)))
    return found


def test_a_record_ends_well_when_the_disk_is_full(small_disk: Path) -> None:
    with pytest.raises(InfrastructureError, match=r"can't write .*a\.mcap: No space left"):
        record(small_disk / "a.mcap", 100)
    found = check_it_ends_well(small_disk / "a.mcap", "No space left on device")
    assert len(found.controller["r1"]) >= 1024
    assert (small_disk / "a.mcap").stat().st_size > 0.6 * DISK_BYTES


@pytest.mark.parametrize("groups", [2, 100])
def test_its_end_was_reserved_before_others_filled_the_disk(small_disk: Path, groups: int) -> None:
    path = small_disk / "a.mcap"
    with contextlib.suppress(InfrastructureError):
        record(path, groups, before=1, meanwhile=lambda: fill(small_disk))
    found = check_it_ends_well(path, "No space left on device")
    assert len(found.controller["r1"]) == 512


def test_what_was_reserved_is_given_back(small_disk: Path) -> None:
    record(small_disk / "a.mcap", 1)
    file = AppendedFile(small_disk / "b")
    file.reserve(DISK_BYTES // 2)
    with pytest.raises(OSError, match="No space left"):
        AppendedFile(small_disk / "c").reserve(DISK_BYTES // 2)
    file.close()
    (small_disk / "c").write_bytes(bytes(DISK_BYTES // 2))


def test_the_last_chunks_make_room_where_nothing_can_be_reserved(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for size in range(200_000, 204_000, 500):
        with (
            largest_file(size),
            pytest.raises(InfrastructureError, match=r"can't write .*: File too large"),
        ):
            record(path, 100)
        assert path.stat().st_size <= size
        check_it_ends_well(path, "File too large")


def test_a_start_on_a_full_disk_leaves_no_file(small_disk: Path) -> None:
    fill(small_disk)
    with pytest.raises(InfrastructureError, match="No space left"):
        RecordWriter(small_disk / "a.mcap", {"r1": SIGNALS}, "", 1_000_000)
    with pytest.raises(InfrastructureError, match="No space left"):
        CanLogWriter(small_disk / "a.blf", small_disk / "a.log", channel=1, name="r1")
    assert [path.name for path in small_disk.iterdir()] == ["others"]


def test_a_start_whose_recordings_fail_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "can").touch()
    with pytest.raises(InfrastructureError, match="can't make"):
        RunRecord(
            tmp_path / "a.mcap", {"r1": SIGNALS}, "", 1_000_000, buses=("r1",), formats=("blf",)
        )
    assert [path.name for path in tmp_path.iterdir()] == ["can"]


@pytest.mark.parametrize("ending", ["blf", "log"])
def test_a_recording_of_a_bus_keeps_what_it_has(small_disk: Path, ending: str) -> None:

    frames = np.zeros(4096, FRAME)
    frames["data"] = np.random.default_rng(1).integers(0, 256, (4096, 8))
    frames["length"] = 8
    path = small_disk / f"a.{ending}"
    paths = [path if ending == other else None for other in ("blf", "log")]
    with (
        pytest.raises(InfrastructureError, match=rf"can't write .*{ending}: No space left"),
        CanLogWriter(*paths, channel=1, name="r1") as log,
    ):
        while True:
            log.write(frames)
    data = frames["data"].tobytes()
    with can.LogReader(path) as reader:
        read = b"".join(bytes(message.data) for message in reader)
    assert len(read) > 100_000
    assert read == (data * (1 + len(read) // len(data)))[: len(read)]


def test_a_record_to_which_no_event_can_be_added_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with RecordWriter(path, {"r1": SIGNALS}, "", 1_000_000) as writer:
        for source, rows in ROWS.items():
            writer.add("r1", source, 0, rows)
    before, record = path.read_bytes(), Record.open(path)
    for room in (0, 60):
        with (
            largest_file(len(before) + room),
            pytest.raises(InfrastructureError, match=r"can't write .*a\.mcap: File too large"),
        ):
            add_events(record, [Event(3, "r1", "stopped", "why " * 99)], 1_000_000)
        assert path.read_bytes() == before
