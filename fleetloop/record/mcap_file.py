"""An MCAP file of fixed-size messages, written chunk by chunk and completed at any time.

The records are the `mcap` package's own; only the bodies of chunks come from numpy, a block of
messages of one channel each. A file that lost its end (its writer was killed) is whole again after
`McapFile.resume(path).finish()`: what was complete stays, the rest is cut off.
"""

import zlib
from io import FileIO
from pathlib import Path
from typing import Self

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from configs.errors import InfrastructureError
from fleetloop.record import schema
from fleetloop.record.scan import MAGIC, scan

LIBRARY = "fleetloop"
SCENARIO = "scenario.toml"
_ZSTD_LEVEL = 1


class McapFile:
    """One record file that is being written."""

    def __init__(self, path: Path, stream: FileIO) -> None:
        self._path = path
        self._stream = stream
        self._offset = 0
        self._schemas: list[records.Schema] = []
        self._channels: list[records.Channel] = []
        self._attachments: list[records.AttachmentIndex] = []
        self._chunks: list[records.ChunkIndex] = []
        self._counts: dict[int, int] = {}
        self._compress = zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress

    @classmethod
    def create(cls, path: Path, robots: tuple[str, ...], scenario_toml: str) -> Self:
        """Begin a new file for these robots.

        Raises:
            InfrastructureError: it can't be written.
        """
        try:
            file = cls(path, path.open("wb", buffering=0))
        except OSError as error:
            raise InfrastructureError(f"can't write {path}: {error.strerror}") from error
        file._write(MAGIC)
        file._put(records.Header(profile="ros2", library=LIBRARY))
        for kind, (name, text) in schema.SCHEMAS.items():
            record = records.Schema(id=kind + 1, name=name, encoding="ros2msg", data=text.encode())
            file._schemas.append(record)
            file._put(record)
        for number, robot in enumerate(robots):
            for kind in schema.Kind:
                channel = records.Channel(
                    id=schema.channel_id(number, kind),
                    schema_id=kind + 1,
                    topic=schema.topic(robot, kind),
                    message_encoding="cdr",
                    metadata={},
                )
                file._channels.append(channel)
                file._put(channel)
        data = scenario_toml.encode()
        attachment = records.Attachment(
            create_time=0, log_time=0, name=SCENARIO, media_type="application/toml", data=data
        )
        file._attach(attachment, file._offset)
        file._put(attachment)
        return file

    @classmethod
    def resume(cls, path: Path) -> Self:
        """Take up a file that lost its end; what isn't complete is cut off."""
        found = scan(path)
        stream = path.open("r+b", buffering=0)
        stream.truncate(found.end)
        stream.seek(found.end)
        file = cls(path, stream)
        file._offset = found.end
        file._schemas, file._channels = found.schemas, found.channels
        for attachment, offset in found.attachments:
            file._attach(attachment, offset)
        for index, channel, count in found.chunks:
            file._chunks.append(index)
            file._counts[channel] = file._counts.get(channel, 0) + count
        return file

    def chunk(self, channel: int, messages: np.ndarray) -> None:
        """Write a block of messages of one channel."""
        if not len(messages):
            return
        body = messages.tobytes()
        packed = self._compress(body)
        start, times = self._offset, messages["log_time"]
        self._put(
            records.Chunk(
                compression="zstd",
                data=packed,
                message_start_time=int(times[0]),
                message_end_time=int(times[-1]),
                uncompressed_crc=zlib.crc32(body),
                uncompressed_size=len(body),
            )
        )
        length = self._offset - start
        index_offset = self._offset
        self._write(_message_index(channel, messages))
        self._chunks.append(
            records.ChunkIndex(
                chunk_start_offset=start,
                chunk_length=length,
                compression="zstd",
                compressed_size=len(packed),
                uncompressed_size=len(body),
                message_start_time=int(times[0]),
                message_end_time=int(times[-1]),
                message_index_length=self._offset - index_offset,
                message_index_offsets={channel: index_offset},
            )
        )
        self._counts[channel] = self._counts.get(channel, 0) + len(messages)

    def finish(self) -> None:
        """Write summary and footer, and close."""
        self._put(records.DataEnd(data_section_crc=0))
        start = self._offset
        for record in (*self._schemas, *self._channels, self._statistics()):
            self._put(record)
        for index in (*self._chunks, *self._attachments):
            self._put(index)
        footer = records.Footer(summary_start=start, summary_offset_start=0, summary_crc=0)
        self._put(footer)
        self._write(MAGIC)
        self._stream.close()

    def close(self) -> None:
        """Close as it is."""
        self._stream.close()

    def _statistics(self) -> records.Statistics:
        starts = [chunk.message_start_time for chunk in self._chunks]
        ends = [chunk.message_end_time for chunk in self._chunks]
        return records.Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(sorted(self._counts.items())),
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_start_time=min(starts, default=0),
            message_end_time=max(ends, default=0),
            metadata_count=0,
            schema_count=len(self._schemas),
        )

    def _attach(self, attachment: records.Attachment, offset: int) -> None:
        builder = RecordBuilder()
        attachment.write(builder)
        self._attachments.append(
            records.AttachmentIndex(
                offset=offset,
                length=builder.count,
                log_time=attachment.log_time,
                create_time=attachment.create_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
        )

    def _put(self, record: records.McapRecord) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._write(builder.end())

    def _write(self, data: bytes) -> None:
        """Hand it to the operating system at once: a kill can't take it back."""
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._stream.write(rest) :]
        except OSError as error:
            self._stream.close()
            raise InfrastructureError(
                f"can't write {self._path}: {error.strerror or error}"
            ) from error
        self._offset += len(data)


def _message_index(channel: int, messages: np.ndarray) -> bytes:
    entries = np.empty(len(messages), [("time", "<u8"), ("offset", "<u8")])
    entries["time"] = messages["log_time"]
    entries["offset"] = np.arange(len(messages)) * messages.dtype.itemsize
    builder = RecordBuilder()
    builder.start_record(Opcode.MESSAGE_INDEX)
    builder.write2(channel)
    builder.write4(entries.nbytes)
    builder.write(entries.tobytes())
    builder.finish_record()
    data: bytes = builder.end()
    return data
