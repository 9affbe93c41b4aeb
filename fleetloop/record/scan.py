"""Walk an MCAP file from its beginning, record by record, up to its end or to where it was cut."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from configs.errors import ScenarioError

MAGIC = b"\x89MCAP0\r\n"
_PREFIX = struct.Struct("<BQ")


class Found(NamedTuple):
    """A record of the file: what it is and where its content begins and ends."""

    opcode: int
    start: int
    content: int
    end: int


@dataclass(slots=True)
class Scan:
    """What the complete part of a file holds."""

    end: int = len(MAGIC)  # where its complete part ends, before any summary
    complete: bool = False  # it has its end
    schemas: list[records.Schema] = field(default_factory=list)
    channels: list[records.Channel] = field(default_factory=list)
    attachments: list[tuple[records.Attachment, int]] = field(default_factory=list)
    chunks: list[tuple[records.ChunkIndex, int, int]] = field(default_factory=list)
    """Index, channel and number of messages of each chunk."""


def scan(path: Path) -> Scan:
    """What is in a record file, complete or cut.

    Raises:
        ScenarioError: it is no MCAP file.
    """
    found = Scan()
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise ScenarioError(f"{path}: not an MCAP file")
        chunk: tuple[records.Chunk, Found] | None = None
        for record in _walk(path, len(MAGIC)):
            stream.seek(record.content)
            data = ReadDataStream(BytesIO(stream.read(record.end - record.content)))
            match record.opcode:
                case Opcode.SCHEMA:
                    found.schemas.append(records.Schema.read(data))
                case Opcode.CHANNEL:
                    found.channels.append(records.Channel.read(data))
                case Opcode.ATTACHMENT:
                    found.attachments.append((records.Attachment.read(data), record.start))
                case Opcode.CHUNK:
                    chunk = records.Chunk.read(data), record
                    continue
                case Opcode.MESSAGE_INDEX if chunk is not None:
                    found.chunks.append(_chunk_index(*chunk, record, data))
                case Opcode.DATA_END:
                    found.complete = True
                    return found
            found.end = record.end
    return found


def _walk(path: Path, offset: int) -> Iterator[Found]:
    size = path.stat().st_size
    with path.open("rb") as stream:
        while offset + _PREFIX.size <= size:
            stream.seek(offset)
            opcode, length = _PREFIX.unpack(stream.read(_PREFIX.size))
            end = offset + _PREFIX.size + length
            if opcode == 0 or end > size:
                return
            yield Found(opcode, offset, offset + _PREFIX.size, end)
            offset = end


def _chunk_index(
    chunk: records.Chunk, at: Found, index: Found, data: ReadDataStream
) -> tuple[records.ChunkIndex, int, int]:
    channel = data.read2()
    count = data.read4() // 16
    return (
        records.ChunkIndex(
            chunk_start_offset=at.start,
            chunk_length=at.end - at.start,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            message_index_length=index.end - index.start,
            message_index_offsets={channel: index.start},
        ),
        channel,
        count,
    )
