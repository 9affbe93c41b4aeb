"""Reads a record from its beginning and checks every byte, up to its end or its cut.

    head       its own check sum                                    `fleetloop.record.head`
    chunks     a check sum each, ticks one after the other          `fleetloop.record.chunks`
    end        Metadata: what is missing in it, DataEnd: check sum of all bytes before
    summary    check sum in the footer; the file ends with it

A file that ends before its end is *cut*; one with a byte that isn't what was written is *damaged*.
"""

import contextlib
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BufferedReader, BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from configs.errors import ScenarioError
from fleetloop.record.chunks import ChunkReader, DamageError, packed_size, summary_of
from fleetloop.record.head import MAGIC, PREFIX, Head, HeadError, encoded, understood

_END, _LOST = "fleetloop.end", "lost"
_FOOTER = struct.Struct("<QQI")
Visit = Callable[[int, np.ndarray], None]


class RecordError(ScenarioError):
    """A file that is no record, or isn't what was written; the text says where and what."""


class Written(NamedTuple):
    """A chunk of the file, and how the file was before it."""

    summary: records.ChunkIndex
    channel: int
    messages: int
    crc_before: int


@dataclass(slots=True)
class Scan:
    """The contents of the undamaged part of a file."""

    head: Head
    end: int  # where the whole chunks end
    crc: int  # of all bytes before
    chunks: list[Written] = field(default_factory=list)
    lost: str = ""
    """The missing part and the cause; empty for a complete, undamaged file."""
    closed: bool = False
    """It has its end and its summary."""
    damaged: bool = False


class _CutError(Exception):
    """The file ends here, and shouldn't."""


class _Found(NamedTuple):
    opcode: int
    start: int
    content: bytes
    crc_before: int


def end_record(lost: str) -> records.Metadata:
    """The end after the last chunk; it names lost parts."""
    return records.Metadata(_END, {_LOST: lost})


def scan(path: Path, visit: Visit = lambda _channel, _messages: None) -> Scan:
    """Scan a record file; `visit` gets channel and messages of a robot's chunks before a damage.

    Raises:
        RecordError: it is no record, its head isn't whole, or it can't be read.
    """
    try:
        with path.open("rb") as stream:
            file = _File(stream)
            found = _head(path, file)
            try:
                _body(file, found, visit)
            except _CutError as cut:
                found.lost = str(cut)
            except DamageError as damage:
                found.lost, found.damaged = str(damage), True
            return found
    except OSError as error:
        raise RecordError(f"{path}: can't be read: {error.strerror or error}") from error


class _File:
    """Records of a file one after the other, with the check sum of all that was read."""

    def __init__(self, stream: BufferedReader) -> None:
        self._stream = stream
        self.size = os.fstat(stream.fileno()).st_size
        self.at = 0
        self.crc = 0
        stream.seek(max(0, self.size - len(MAGIC)))
        self.ends_well = self.size > 2 * len(MAGIC) and stream.read() == MAGIC
        stream.seek(0)

    def bytes(self, length: int) -> bytes:
        """The next bytes."""
        if self.at + length > self.size:
            if self.ends_well:
                raise DamageError(
                    f"damaged at byte {self.at}: the record there is longer than the file"
                )
            raise _CutError(f"cut at byte {self.size}")
        data = self._stream.read(length)
        self.at += length
        self.crc = zlib.crc32(data, self.crc)
        return data

    def record(self) -> _Found:
        """The next record."""
        start, crc = self.at, self.crc
        opcode, length = PREFIX.unpack(self.bytes(PREFIX.size))
        if opcode == 0:
            self._refuse_zeros(start)
        return _Found(opcode, start, self.bytes(length), crc)

    def _refuse_zeros(self, start: int) -> None:
        self._stream.seek(start)
        for block in iter(lambda: self._stream.read(1 << 20), b""):
            if block.count(0) != len(block):
                raise DamageError(f"damaged at byte {start}: no record there")
        raise _CutError(f"cut at byte {start}, only zeros follow")


def _head(path: Path, file: _File) -> Scan:
    if not file.size:
        raise RecordError(f"{path}: empty, not a record")
    found: list[tuple[int, bytes]] = []
    try:
        if file.bytes(len(MAGIC)) != MAGIC:
            raise RecordError(f"{path}: not an MCAP file")
        record = file.record()
        while record.opcode in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT):
            found.append((record.opcode, record.content))
            record = file.record()
        found.append((record.opcode, record.content))
        return Scan(understood(found, record.crc_before), file.at, file.crc)
    except _CutError as cut:
        raise RecordError(f"{path}: {cut}, before the first row") from cut
    except (DamageError, HeadError) as error:
        raise RecordError(f"{path}: {error}") from error


def _body(file: _File, found: Scan, visit: Visit) -> None:
    """Chunks, end and summary."""
    chunks = ChunkReader(found.head.layout)
    record = file.record()
    while record.opcode == Opcode.CHUNK:
        index = file.record()
        with _naming_place(record.start):
            if index.opcode != Opcode.MESSAGE_INDEX:
                raise DamageError("a chunk without index")
            block, messages = chunks.unpack(record.content, index.content)
        length, packed = index.start - record.start, packed_size(record.content)
        summary = summary_of(block, record.start, length, packed)
        count = len(block.times_ns)
        found.chunks.append(Written(summary, block.channel, count, record.crc_before))
        if messages is not None:
            visit(block.channel, messages)
        found.end, found.crc = file.at, file.crc
        record = file.record()
    with _naming_place(record.start):
        lost = _missing(record)
    record = file.record()
    with _naming_place(record.start):
        if record.opcode != Opcode.DATA_END or len(record.content) != 4:
            raise DamageError("no end of the rows")
        if int.from_bytes(record.content, "little") != record.crc_before:
            raise DamageError("the check sum over all rows differs")
    try:
        _summary(file)
    except _CutError as cut:
        raise _CutError(f"{cut}, behind its last row") from cut
    found.closed, found.lost = True, lost


def _missing(record: _Found) -> str:
    """The missing part, according to the end."""
    if record.opcode != Opcode.METADATA:
        raise DamageError(f"a record of kind {record.opcode}, not a chunk")
    try:
        end = records.Metadata.read(ReadDataStream(BytesIO(record.content)))
    except (McapError, ValueError, struct.error) as error:
        raise DamageError("the end of the rows is damaged") from error
    lost: str | None = end.metadata.get(_LOST)
    if end.name != _END or lost is None or encoded(end)[PREFIX.size :] != record.content:
        raise DamageError("the end of the rows is damaged")
    return lost


def _summary(file: _File) -> None:
    """Everything behind the rows, up to the last byte."""
    start = file.at
    file.crc = 0
    record = file.record()
    while record.opcode != Opcode.FOOTER:
        record = file.record()
    with _naming_place(start):
        if len(record.content) != _FOOTER.size:
            raise DamageError("the footer is damaged")
        summary_start, _, crc = _FOOTER.unpack(record.content)
        before = PREFIX.pack(record.opcode, _FOOTER.size) + record.content[:-4]
        if summary_start != start or zlib.crc32(before, record.crc_before) != crc:
            raise DamageError("the check sum of the summary differs")
    if file.bytes(len(MAGIC)) != MAGIC or file.at != file.size:
        raise DamageError(f"damaged at byte {file.at}: more than a record")


@contextlib.contextmanager
def _naming_place(start: int) -> Iterator[None]:
    """Name the place of a damage."""
    try:
        yield
    except DamageError as damage:
        raise DamageError(f"damaged at byte {start}: {damage}") from damage
