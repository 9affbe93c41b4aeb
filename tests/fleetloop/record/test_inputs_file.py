"""The file of an input log: cut it is shorter, damaged it is refused."""

from pathlib import Path

import pytest

from fleetloop.record.inputs_file import InputLog, InputsFile, path_of, read_inputs
from fleetloop.record.scan import RecordError

BLOCKS = [b"one" * 100, b"two" * 1000, b"three"]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = path_of(tmp_path, "r1")
    path.parent.mkdir()
    return path


def written(path: Path, *, final: bool = True) -> bytes:
    file = InputsFile(path)
    for block in BLOCKS:
        file.write(file.next_byte, block, final=False)
    if final:
        file.write(file.next_byte, b"", final=True)
    file.close()
    return path.read_bytes()


def test_a_log_comes_out_as_it_was_and_says_whether_it_is_whole(path: Path) -> None:
    written(path)
    assert read_inputs(path) == [InputLog(b"".join(BLOCKS), True)]
    written(path, final=False)
    assert read_inputs(path) == [InputLog(b"".join(BLOCKS), False)]


def test_a_controller_that_was_started_again_has_a_log_of_its_own(path: Path) -> None:
    file = InputsFile(path)
    file.write(0, b"first", final=False)
    file.write(0, b"second", final=True)
    file.close()
    assert read_inputs(path) == [InputLog(b"first", False), InputLog(b"second", True)]


def test_a_file_that_is_cut_anywhere_gives_whole_blocks_and_is_not_complete(path: Path) -> None:
    data = written(path)
    whole = b"".join(BLOCKS)
    for end in range(19, len(data), 7):
        path.write_bytes(data[:end])
        for log in read_inputs(path):
            assert whole.startswith(log.entries)
            assert not log.complete


def test_a_byte_that_changed_is_refused_with_its_place(path: Path) -> None:
    data = bytearray(written(path))
    for at in range(19, len(data), 5):
        data[at] ^= 0x40
        path.write_bytes(data)
        try:
            logs = read_inputs(path)
        except RecordError as error:
            assert f"{path}: " in str(error)
        else:  # a length that leads beyond the end looks like a cut
            assert all(not log.complete for log in logs)
        data[at] ^= 0x40
    path.write_bytes(b"something else")
    with pytest.raises(RecordError, match="not an input log"):
        read_inputs(path)
