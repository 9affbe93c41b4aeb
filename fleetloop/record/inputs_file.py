"""The input log of one controller in a run's folder, `inputs/<robot>.inputs`.

A line that says what it is, then pieces, each whole or not at all:

    first u64   length u32   packed u32   check sum u32   the bytes, zstd        little endian

    first       place of the piece's first byte in the log; 0 where a controller begins, or again
    length      of its bytes in the log; 0: the log ends here, nothing is missing in it
    packed      length in the file
    check sum   CRC-32 of all of the piece but itself

What is in the log: `bridge.network.inputs`.
"""

import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import zstandard

from configs.errors import InfrastructureError
from fleetloop.record.append import AppendedFile
from fleetloop.record.scan import RecordError

FOLDER = "inputs"
_MAGIC = b"fleetloop inputs 1\n"
_PIECE = struct.Struct("<QII")
_CHECK = struct.Struct("<I")
_LEVEL = 1
_MOST_BYTES = 1 << 20
"""Of a piece."""


def path_of(folder: Path, robot: str) -> Path:
    """The file of a robot in a run's folder."""
    return folder / FOLDER / f"{robot}.inputs"


class InputLog(NamedTuple):
    """The log of one controller process."""

    entries: bytes
    complete: bool
    """Nothing is missing at its end: its process was not killed."""


class InputsFile:
    """Writes the logs of one robot's controllers, one after the other.

    Raises:
        InfrastructureError: the file can't be written; so do its methods.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._compress = zstandard.ZstdCompressor(level=_LEVEL).compress
        self.next_byte = 0
        """Where the log goes on."""
        try:
            self._file = AppendedFile(path)
            self._file.append(_MAGIC)
        except OSError as error:
            raise self._failure(error) from error

    def write(self, first: int, block: bytes, *, final: bool) -> None:
        """Append a block of a log that goes on, or of one that begins; `final`: it ends."""
        pieces = [(first, block)] if block else []
        if final:
            pieces.append((first + len(block), b""))
        for at, raw in pieces:
            packed = self._compress(raw) if raw else b""
            head = _PIECE.pack(at, len(raw), len(packed))
            check = _CHECK.pack(zlib.crc32(packed, zlib.crc32(head)))
            try:
                self._file.append(head + check + packed)
            except OSError as error:
                raise self._failure(error) from error
        self.next_byte = first + len(block)

    def close(self) -> None:
        """Close it. Idempotent."""
        self._file.close()

    def discard(self) -> None:
        """Close and remove it."""
        self._file.discard()

    def _failure(self, error: OSError) -> InfrastructureError:
        return InfrastructureError(f"can't write {self._path}: {error.strerror or error}")


def read_inputs(path: Path) -> list[InputLog]:
    """The logs in a file, in the order of their controllers; a cut piece at its end is left out.

    Raises:
        RecordError: it is no such file, or damaged; the text says where.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"{path}: {error.strerror or error}") from error
    if not data.startswith(_MAGIC):
        raise RecordError(f"{path}: not an input log of this version of Fleetloop")
    logs: list[InputLog] = []
    parts: list[bytes] = []
    at, expected, complete = len(_MAGIC), 0, False
    while (found := _piece(path, data, at)) is not None:
        first, raw, at = found
        if first == 0 and parts:
            logs.append(InputLog(b"".join(parts), complete))
            parts, expected = [], 0
        if first != expected:
            raise RecordError(f"{path}: a piece begins at byte {first} of the log, not {expected}")
        complete = not raw
        parts.append(raw)
        expected = first + len(raw)
    return [*logs, InputLog(b"".join(parts), complete)] if parts else logs


def _piece(path: Path, data: bytes, at: int) -> tuple[int, bytes, int] | None:
    """First byte, content and end of the piece at a place of the file, None if it is cut there."""
    begin = at + _PIECE.size + _CHECK.size
    if begin > len(data):
        return None
    first, length, size = _PIECE.unpack_from(data, at)
    end = begin + size
    if end > len(data):
        return None
    packed = data[begin:end]
    check = zlib.crc32(packed, zlib.crc32(data[at : at + _PIECE.size]))
    if check != _CHECK.unpack_from(data, at + _PIECE.size)[0] or length > _MOST_BYTES:
        raise RecordError(f"{path}: damaged at byte {at}: its check sum is another")
    if not length:
        return first, b"", end
    try:
        raw = zstandard.ZstdDecompressor().decompress(packed, max_output_size=length)
    except zstandard.ZstdError as error:
        raise RecordError(f"{path}: damaged at byte {at}: {error}") from error
    return first, raw, end
