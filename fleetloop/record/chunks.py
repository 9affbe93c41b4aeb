"""Chunks of a record: messages of one channel with their index and check sum.

    Chunk         times of its first and last message, CRC-32, size, zstd-compressed messages
    MessageIndex  channel; of every message its time and where it is in the chunk

The check sum covers the messages; all other bytes of both records follow from them, and have to.
"""

import struct
import zlib
from typing import NamedTuple

import numpy as np
import zstandard
from mcap import records
from mcap.opcode import Opcode

from fleetloop.record import schema
from fleetloop.record.head import PREFIX, encoded
from fleetloop.record.schema import Kind, Layout

CHUNK_TICKS = 512
_ZSTD_LEVEL = 1
_COMPRESSION = "zstd"
_CHUNK = struct.Struct("<QQQII4sQ")
_INDEX = struct.Struct("<HI")
_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])


class DamageError(Exception):
    """Bytes that differ from the written ones; the text names the difference."""


class Packed(NamedTuple):
    """A chunk with its index as they are in the file, and what the summary says of both."""

    data: bytes
    summary: records.ChunkIndex
    channel: int
    messages: int


class ChunkWriter:
    """Packs chunks."""

    def __init__(self) -> None:
        self._compress = zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress

    def pack(self, channel: int, messages: np.ndarray, start: int) -> Packed:
        """A chunk of messages of one channel, to be written at `start`."""
        body = messages.tobytes()
        packed = self._compress(body)
        chunk = encoded(
            records.Chunk(
                compression=_COMPRESSION,
                data=packed,
                message_start_time=int(messages["log_time"][0]),
                message_end_time=int(messages["log_time"][-1]),
                uncompressed_crc=zlib.crc32(body),
                uncompressed_size=len(body),
            )
        )
        content = _index_content(channel, messages)
        index = PREFIX.pack(Opcode.MESSAGE_INDEX, len(content)) + content
        return Packed(
            chunk + index,
            summary_of(channel, messages, start, len(chunk), len(packed)),
            channel,
            len(messages),
        )


class ChunkReader:
    """Unpacks chunks of a file in their order, and refuses those that differ from the written."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._channels = range(1, len(layout.robots) * len(Kind) + 1)
        self._next_tick = dict.fromkeys(self._channels, 0)
        self._decompress = zstandard.ZstdDecompressor().decompress

    def unpack(self, chunk: bytes, index: bytes) -> tuple[int, np.ndarray]:
        """Channel and messages of a chunk, from the contents of both its records.

        Raises:
            DamageError: something of them isn't right.
        """
        if len(chunk) < _CHUNK.size or len(index) < _INDEX.size:
            raise DamageError("a chunk is too short")
        first_ns, last_ns, size, crc, _, compression, length = _CHUNK.unpack_from(chunk)
        packed = chunk[_CHUNK.size :]
        channel = _INDEX.unpack_from(index)[0]
        if compression != _COMPRESSION.encode() or length != len(packed):
            raise DamageError("the head of a chunk is damaged")
        if channel not in self._channels:
            raise DamageError(f"a chunk of an unknown channel, {channel}")
        messages = self._messages(packed, size, crc, channel)
        if index != _index_content(channel, messages):
            raise DamageError("the index of a chunk doesn't fit its messages")
        if (first_ns, last_ns) != (messages["log_time"][0], messages["log_time"][-1]):
            raise DamageError("the times of a chunk aren't those of its messages")
        self._follow(channel, messages)
        return channel, messages

    def _messages(self, packed: bytes, size: int, crc: int, channel: int) -> np.ndarray:
        layout = self._layout.message_type(channel)
        if not 0 < size <= CHUNK_TICKS * layout.itemsize or size % layout.itemsize:
            raise DamageError(f"a chunk of {size} bytes, not 1 to {CHUNK_TICKS} messages")
        try:
            if zstandard.frame_content_size(packed) != size:
                raise DamageError("a chunk says two sizes")
            body = self._decompress(packed, max_output_size=size)
        except zstandard.ZstdError as error:
            raise DamageError(f"a chunk can't be decompressed ({error})") from error
        if zlib.crc32(body) != crc:
            raise DamageError("the check sum of a chunk differs")
        messages = np.frombuffer(body, layout)
        if (messages["channel"] != channel).any():
            raise DamageError("a chunk holds messages of another channel than its index")
        return messages

    def _follow(self, channel: int, messages: np.ndarray) -> None:
        """Refuse ticks that are missing, come twice, or stand in another order."""
        ticks = messages["sequence"]
        expected = self._next_tick[channel]
        is_pose = schema.kind_of(channel) is Kind.POSE  # of some ticks only
        if not (ticks[0] >= expected if is_pose else ticks[0] == expected):
            name = f"{schema.kind_of(channel).name.lower()} rows of robot"
            number = schema.robot_number_of(channel) + 1
            raise DamageError(f"{name} {number} go on at tick {ticks[0]}, expected {expected}")
        self._next_tick[channel] = int(ticks[-1]) + 1


def summary_of(
    channel: int, messages: np.ndarray, start: int, length: int, compressed: int
) -> records.ChunkIndex:
    """The summary's entry of a chunk of so many bytes at `start`."""
    index_length = PREFIX.size + _INDEX.size + len(messages) * _ENTRY.itemsize
    return records.ChunkIndex(
        chunk_start_offset=start,
        chunk_length=length,
        compression=_COMPRESSION,
        compressed_size=compressed,
        uncompressed_size=messages.nbytes,
        message_start_time=int(messages["log_time"][0]),
        message_end_time=int(messages["log_time"][-1]),
        message_index_length=index_length,
        message_index_offsets={channel: start + length},
    )


def packed_size(chunk: bytes) -> int:
    """Bytes of the compressed messages in the content of a Chunk record."""
    return len(chunk) - _CHUNK.size


def _index_content(channel: int, messages: np.ndarray) -> bytes:
    entries = np.empty(len(messages), _ENTRY)
    entries["time"] = messages["log_time"]
    entries["offset"] = np.arange(len(messages)) * messages.dtype.itemsize
    return _INDEX.pack(channel, entries.nbytes) + entries.tobytes()
