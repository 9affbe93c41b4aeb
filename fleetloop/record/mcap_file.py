"""An MCAP file of fixed-size messages, written chunk by chunk and completed at any time.

Chunks come from numpy, a block of messages of one channel each; head and summary are records of the
`mcap` package. Space for the summary is reserved before each chunk, so that the file can be
completed on a disk that has become full; where a file system reserves nothing, the last chunks make
room. A file that lost its end (its writer was killed) is whole again after
`McapFile.resume(path).finish(why)`: what was complete stays, the rest is cut off.
"""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import numpy as np
from mcap import records

from configs.errors import InfrastructureError
from fleetloop.record.append import AppendedFile
from fleetloop.record.chunks import ChunkWriter
from fleetloop.record.head import MAGIC, Head, build, encoded
from fleetloop.record.scan import RecordError, Written, end_record, scan
from fleetloop.record.schema import Layout

_LOST_BYTES = 1024
"""The reason that the end gives is cut off there."""


class McapFile:
    """One record file that is being written."""

    def __init__(self, path: Path, file: AppendedFile, head: Head) -> None:
        self._path = path
        self._file = file
        self._head = head
        self._crc = 0
        self._chunks: list[Written] = []
        self._writer = ChunkWriter()
        self._closed = False
        nothing = records.ChunkIndex(0, 0, "zstd", 0, 0, 0, {1: 0}, 0, 0)
        self._index_bytes = len(encoded(nothing))
        channels = len(head.channels) * 10  # of the statistics
        self._tail_bytes = len(self._tail("")) + _LOST_BYTES + channels

    @classmethod
    def create(cls, path: Path, layout: Layout, scenario_toml: str) -> Self:
        """Begin a new file of this layout.

        Raises:
            InfrastructureError: it can't be written; no file of it stays.
        """
        head = build(layout, scenario_toml)
        try:
            file = AppendedFile(path)
        except OSError as error:
            raise InfrastructureError(f"can't write {path}: {error.strerror}") from error
        record = cls(path, file, head)
        try:
            record._append(head.data)
        except InfrastructureError:
            file.discard()
            raise
        return record

    @classmethod
    def resume(cls, path: Path) -> Self:
        """Take up a file that lost its end; what isn't complete is cut off.

        Raises:
            RecordError: it is damaged, so what follows the damage would be lost.
            InfrastructureError: it can't be written.
        """
        found = scan(path)
        if found.damaged:
            raise RecordError(f"{path}: {found.lost}")
        try:
            file = AppendedFile(path, goes_on=True)
            if not found.closed:
                file.cut(found.end)
        except OSError as error:
            raise InfrastructureError(f"can't write {path}: {error.strerror}") from error
        record = cls(path, file, found.head)
        record._crc, record._chunks, record._closed = found.crc, found.chunks, found.closed
        return record

    def chunk(self, channel: int, messages: np.ndarray) -> None:
        """Write a block of messages of one channel.

        Raises:
            InfrastructureError: it can't be written; the file is as it was and can be finished.
        """
        if not len(messages):
            return
        crc_before = self._crc
        packed = self._writer.pack(channel, messages, self._file.size)
        self._append(packed.data)
        self._chunks.append(Written(packed.summary, channel, len(messages), crc_before))

    def finish(self, lost: str = "") -> None:
        """Write end, summary and footer, and close; `lost` says what is missing in the file.

        Raises:
            InfrastructureError: it can't be written, or not without dropping chunks.
        """
        if self._closed:
            self._file.close()
            return
        failure: OSError | None = None
        while True:
            tail = self._tail(lost)
            try:
                self._file.append(tail)
                break
            except OSError as error:
                failure = error
                lost = lost or f"can't write it: {error.strerror}"
                if not self._make_room(len(tail)):
                    break
        self._closed = True
        self._file.close()
        if failure is not None:
            raise self._unwritable(failure) from failure

    @property
    def in_place(self) -> bool:
        """Whether its path still leads to it."""
        return self._file.in_place()

    def discard(self) -> None:
        """Close and remove it."""
        self._file.discard()

    def _make_room(self, length: int) -> bool:
        """Drop the last chunks that have so many bytes together; return whether there were any."""
        size = self._file.size
        if not self._chunks:
            return False
        while self._chunks and size - self._file.size < length:
            last = self._chunks.pop()
            self._crc = last.crc_before
            self._file.cut(last.summary.chunk_start_offset)
        return True

    def _append(self, data: bytes) -> None:
        """Hand it to the operating system at once: a kill can't take it back."""
        tail = self._tail_bytes + (len(self._chunks) + 1) * self._index_bytes
        try:
            self._file.reserve(len(data) + tail)
            self._file.append(data)
        except OSError as error:
            raise self._unwritable(error) from error
        self._crc = zlib.crc32(data, self._crc)

    def _unwritable(self, error: OSError) -> InfrastructureError:
        return InfrastructureError(f"can't write {self._path}: {error.strerror or error}")

    def _tail(self, lost: str) -> bytes:
        """Everything behind the last chunk."""
        end = end_record(lost.encode()[:_LOST_BYTES].decode(errors="ignore"))
        ended = encoded(end)
        rows_end = ended + encoded(records.DataEnd(zlib.crc32(ended, self._crc)))
        index = records.MetadataIndex(self._file.size, len(ended), end.name)
        summary = b"".join(map(encoded, self._summary(index)))
        start = self._file.size + len(rows_end)
        footer = encoded(records.Footer(start, 0, 0))[:-4]
        crc = zlib.crc32(footer, zlib.crc32(summary))
        return rows_end + summary + footer + crc.to_bytes(4, "little") + MAGIC

    def _summary(self, end: records.MetadataIndex) -> Iterator[records.McapRecord]:
        yield from self._head.schemas
        yield from self._head.channels
        yield self._statistics()
        yield from (chunk.summary for chunk in self._chunks)
        yield self._head.attachment
        yield self._head.metadata
        yield end

    def _statistics(self) -> records.Statistics:
        counts: dict[int, int] = {}
        for chunk in self._chunks:
            counts[chunk.channel] = counts.get(chunk.channel, 0) + chunk.messages
        starts = [chunk.summary.message_start_time for chunk in self._chunks]
        ends = [chunk.summary.message_end_time for chunk in self._chunks]
        return records.Statistics(
            attachment_count=1,
            channel_count=len(self._head.channels),
            channel_message_counts=dict(sorted(counts.items())),
            chunk_count=len(self._chunks),
            message_count=sum(counts.values()),
            message_start_time=min(starts, default=0),
            message_end_time=max(ends, default=0),
            metadata_count=2,
            schema_count=len(self._head.schemas),
        )
