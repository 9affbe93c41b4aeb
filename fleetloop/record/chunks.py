"""Chunks of a record: messages of one channel with their index and check sum.

    Chunk         times of its first and last message, CRC-32, size, zstd-compressed messages
    MessageIndex  channel; of every message its time and where it is in the chunk

The check sum covers the messages; all other bytes of both records follow from them, and have to.
Messages of a robot's channel are of equal length, so that they are read as one numpy array; those
of a view are only followed from one to the next.
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
from fleetloop.record.schema import Kind, Layout, View

CHUNK_TICKS = 512
MOST_VIEW_BYTES = 1 << 28
"""Of the messages of a view in a chunk; a larger size is a damage."""
_ZSTD_LEVEL = 1
_COMPRESSION = "zstd"
_CHUNK = struct.Struct("<QQQII4sQ")
_INDEX = struct.Struct("<HI")
_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])
_HEAD = struct.Struct("<BQHIQ")
"""Of a message: opcode, length, channel, sequence, log time."""
_LEAST_LENGTH = 26
"""Of a message: what its head, the time of its publication and the header of CDR take."""


class DamageError(Exception):
    """Bytes that differ from the written ones; the text names the difference."""


class Block(NamedTuple):
    """Messages of one channel, one behind the other."""

    channel: int
    body: bytes
    sequences: np.ndarray
    times_ns: np.ndarray
    offsets: np.ndarray
    """Where in the body each begins."""

    @classmethod
    def of(cls, channel: int, *parts: np.ndarray) -> "Block":
        """Those of all parts; of each part they are of equal length."""
        body = b"".join(part.tobytes() for part in parts)
        if len(parts) == 1:
            return cls(channel, body, *_places(parts[0]))
        begins = np.cumsum([0, *(part.nbytes for part in parts[:-1])])
        places = [_places(part, begin) for part, begin in zip(parts, begins, strict=True)]
        return cls(channel, body, *map(np.concatenate, zip(*places, strict=True)))

    @classmethod
    def followed(cls, channel: int, body: bytes) -> "Block":
        """Those of a body, whatever their lengths.

        Raises:
            DamageError: it isn't messages of this channel from its beginning to its end.
        """
        heads, offsets, at = [], [], 0
        while at < len(body):
            head = body[at : at + _HEAD.size]
            if len(head) < _HEAD.size:
                raise DamageError("a message is too short")
            opcode, length, of_channel, sequence, time_ns = _HEAD.unpack(head)
            if opcode != Opcode.MESSAGE or of_channel != channel or length < _LEAST_LENGTH:
                raise DamageError("a chunk holds messages of another channel than its index")
            heads.append((sequence, time_ns))
            offsets.append(at)
            at += PREFIX.size + length
        if at > len(body):
            raise DamageError("a message is longer than its chunk")
        sequences, times_ns = np.array(heads, "<u8").reshape(-1, 2).T
        return cls(channel, body, sequences, times_ns, np.array(offsets, "<u8"))

    def __bool__(self) -> bool:
        return len(self.times_ns) > 0


def _places(messages: np.ndarray, begin: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sequences, times and offsets of messages of equal length that begin there."""
    offsets = begin + np.arange(len(messages)) * messages.dtype.itemsize
    return messages["sequence"], messages["log_time"], offsets


class Packed(NamedTuple):
    """A chunk with its index as they are in the file, and what the summary says of both."""

    data: bytes
    summary: records.ChunkIndex


class ChunkWriter:
    """Packs chunks."""

    def __init__(self) -> None:
        self._compress = zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress

    def pack(self, block: Block, start: int) -> Packed:
        """A chunk of messages, at least one, to be written at `start`."""
        packed = self._compress(block.body)
        chunk = encoded(
            records.Chunk(
                compression=_COMPRESSION,
                data=packed,
                message_start_time=int(block.times_ns[0]),
                message_end_time=int(block.times_ns[-1]),
                uncompressed_crc=zlib.crc32(block.body),
                uncompressed_size=len(block.body),
            )
        )
        content = _index_content(block)
        index = PREFIX.pack(Opcode.MESSAGE_INDEX, len(content)) + content
        return Packed(chunk + index, summary_of(block, start, len(chunk), len(packed)))


class ChunkReader:
    """Unpacks chunks of a file in their order, and refuses those that differ from the written."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._next = dict.fromkeys(layout.channels, 0)
        self._decompress = zstandard.ZstdDecompressor().decompress

    def unpack(self, chunk: bytes, index: bytes) -> tuple[Block, np.ndarray | None]:
        """The messages of a chunk, from the contents of both its records; None: of a view.

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
        if channel not in self._next:
            raise DamageError(f"a chunk of an unknown channel, {channel}")
        messages = None
        if schema.view_of(channel) is not None:
            body = self._body(packed, size, crc, MOST_VIEW_BYTES)
            block = Block.followed(channel, body)
        else:
            layout = self._layout.message_type(channel)
            body = self._body(packed, size, crc, CHUNK_TICKS * layout.itemsize, layout.itemsize)
            messages = np.frombuffer(body, layout)
            if (messages["channel"] != channel).any():
                raise DamageError("a chunk holds messages of another channel than its index")
            block = Block(channel, body, *_places(messages))
        if index != _index_content(block):
            raise DamageError("the index of a chunk doesn't fit its messages")
        if (first_ns, last_ns) != (block.times_ns[0], block.times_ns[-1]):
            raise DamageError("the times of a chunk aren't those of its messages")
        self._follow(block)
        return block, messages

    def _body(self, packed: bytes, size: int, crc: int, most: int, each: int = 1) -> bytes:
        if not 0 < size <= most or size % each:
            raise DamageError(f"a chunk of {size} bytes, not 1 to {most // each} messages")
        try:
            if zstandard.frame_content_size(packed) != size:
                raise DamageError("a chunk says two sizes")
            body = self._decompress(packed, max_output_size=size)
        except zstandard.ZstdError as error:
            raise DamageError(f"a chunk can't be decompressed ({error})") from error
        if zlib.crc32(body) != crc:
            raise DamageError("the check sum of a chunk differs")
        return body

    def _follow(self, block: Block) -> None:
        """Refuse ticks that are missing, come twice, or stand in another order; events likewise."""
        channel, first = block.channel, int(block.sequences[0])
        expected = self._next[channel]
        if not (first == expected or (first > expected and _of_some_ticks(channel))):
            what = self._layout.topic(channel)
            raise DamageError(f"messages of {what} go on at {first}, expected {expected}")
        self._next[channel] = int(block.sequences[-1]) + 1


def _of_some_ticks(channel: int) -> bool:
    view = schema.view_of(channel)
    if view is None:
        return schema.kind_of(channel) is Kind.POSE
    return view is not View.LOG


def summary_of(block: Block, start: int, length: int, compressed: int) -> records.ChunkIndex:
    """The summary's entry of a chunk of so many bytes at `start`."""
    index_length = PREFIX.size + _INDEX.size + len(block.times_ns) * _ENTRY.itemsize
    return records.ChunkIndex(
        chunk_start_offset=start,
        chunk_length=length,
        compression=_COMPRESSION,
        compressed_size=compressed,
        uncompressed_size=len(block.body),
        message_start_time=int(block.times_ns[0]),
        message_end_time=int(block.times_ns[-1]),
        message_index_length=index_length,
        message_index_offsets={block.channel: start + length},
    )


def packed_size(chunk: bytes) -> int:
    """Bytes of the compressed messages in the content of a Chunk record."""
    return len(chunk) - _CHUNK.size


def _index_content(block: Block) -> bytes:
    entries = np.empty(len(block.times_ns), _ENTRY)
    entries["time"] = block.times_ns
    entries["offset"] = block.offsets
    return _INDEX.pack(block.channel, entries.nbytes) + entries.tobytes()
