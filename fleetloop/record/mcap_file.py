"""An MCAP file of fixed-size messages, written chunk by chunk and completed at any time.

Chunks come from numpy, a block of messages of one channel each; head and summary are records of the
`mcap` package. Space for the summary is reserved before each chunk, so that the file can be
completed on a disk that has become full; where a file system reserves nothing, the last chunks make
room. A file that lost its end (its writer was killed) is whole again after
`McapFile.resume(path).finish(why)`: what was complete stays, the rest is cut off. Of a complete one
`McapFile.reopen(path, scan)` adds to what is in it.
"""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from mcap import records

from configs.errors import InfrastructureError
from fleetloop.record.append import AppendedFile
from fleetloop.record.chunks import Block, ChunkWriter
from fleetloop.record.head import MAGIC, Head, build, encoded
from fleetloop.record.scan import RecordError, Scan, Written, end_record, scan
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
        self._tail_bytes = len(self._tail("", 0)) + _LOST_BYTES + channels

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

    @classmethod
    def reopen(cls, path: Path, found: Scan) -> Self:
        """Take up a complete file, to add to it; `found` is what a scan of it gave.

        Raises:
            InfrastructureError: it can't be read or written.
        """
        try:
            file = AppendedFile(path, goes_on=True)
            file.take_tail(path, found.end)
        except OSError as error:
            raise InfrastructureError(f"can't write {path}: {error.strerror}") from error
        record = cls(path, file, found.head)
        record._crc, record._chunks = found.crc, list(found.chunks)
        return record

    def add(self, block: Block, lost: str) -> None:
        """Add messages of one channel to a complete file, and close it.

        Raises:
            InfrastructureError: it can't be written; the file is as it was.
        """
        try:
            packed, written = self._packed(block)
            self._chunks.append(written)
            self._crc = zlib.crc32(packed, self._crc)
            self._file.append(packed + self._tail(lost, self._file.size + len(packed)))
        except OSError as error:
            raise self._unwritable(error) from error
        finally:
            self._file.close()

    def chunk(self, block: Block) -> None:
        """Write messages of one channel.

        Raises:
            InfrastructureError: it can't be written; the file is as it was and can be finished.
        """
        if not block:
            return
        packed, written = self._packed(block)
        self._append(packed)
        self._chunks.append(written)

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
            tail = self._tail(lost, self._file.size)
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

    def _packed(self, block: Block) -> tuple[bytes, Written]:
        """The bytes of a chunk behind the last."""
        packed = self._writer.pack(block, self._file.size)
        count = len(block.times_ns)
        return packed.data, Written(packed.summary, block.channel, count, self._crc)

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

    def _tail(self, lost: str, begin: int) -> bytes:
        """Everything behind the last chunk, which ends there."""
        end = end_record(lost.encode()[:_LOST_BYTES].decode(errors="ignore"))
        ended = encoded(end)
        rows_end = ended + encoded(records.DataEnd(zlib.crc32(ended, self._crc)))
        index = records.MetadataIndex(begin, len(ended), end.name)
        summary = b"".join(map(encoded, self._summary(index)))
        start = begin + len(rows_end)
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
