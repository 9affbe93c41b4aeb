"""Vector's binary logging format (BLF): CAN frames as objects in compressed containers.

No specification is public; this is the layout of python-can's `can.io.blf` and of Vector_BLF (T.
Lorenz), little endian:

    file         "LOGG", u32 144, ..., u64 size, u64 size uncompressed, u32 objects, ...   144 bytes
    container    "LOBJ", ... type 10, u16 2 (zlib), 6 bytes, u32 size, 4 bytes, content, padding
    object       "LOBJ", u16 header size, u16 1, u32 size, u32 type,
                 u32 2 (nanoseconds), u16 0, u16 0, u64 time                                32 bytes
      type 1     u16 channel, u8 flags (0x80 remote, 1 Tx), u8 length, u32 id, 8 bytes data 16 bytes
      type 73    error frame: u16 channel, ..., u8 length, ..., u32 id, ..., 8 bytes data   32 bytes

    id           bit 31: 29-bit identifier; of an error frame: its error classes

Every container holds whole objects and is written by one call, and the file's header is brought up
to date after it: a killed writer leaves a file that ends at its last flush. A container that was
flushed before it was full is written again once it is.
"""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.frame import EFF, ERR, ID_MASK_29, MAX_DATA, RTR
from fleetloop.record.append import AppendedFile

Array = npt.NDArray[Any]

HEADER_SIZE = 144
_FILE_HEADER = struct.Struct("<4sLBBBBBBBBQQLL8H8H")
OBJECT_HEADER = struct.Struct("<4sHHLL")
CONTAINER = struct.Struct("<H6xL4x")
_APPLICATION = (5, 0, 0, 0)  # as python-can's
_FORMAT_VERSION = (2, 6, 8, 1)
_CONTAINER_TYPE, FRAME_TYPE, _ERROR_TYPE = 10, 1, 73
ZLIB, _NANOSECONDS = 2, 2
REMOTE, TRANSMITTED = 0x80, 0x01
_NO_DATE = (0,) * 8
CONTAINER_FRAMES = 2048
"""Containers of at most 128 KiB, as tools expect them, even if all are error frames."""
_FAST = 1
_FROM_DRIVE = 1

_HEAD = [
    ("signature", "S4"),
    ("header_size", "<u2"),
    ("header_version", "<u2"),
    ("size", "<u4"),
    ("type", "<u4"),
    ("time_unit", "<u4"),
    ("client", "<u2"),
    ("version", "<u2"),
    ("time", "<u8"),
    ("channel", "<u2"),
]
FRAME_OBJECT = np.dtype(
    [*_HEAD, ("flags", "u1"), ("length", "u1"), ("id", "<u4"), ("data", "u1", (MAX_DATA,))]
)
_ERROR_OBJECT = np.dtype(
    [
        *_HEAD,
        ("frame_length", "<u2"),
        ("flags", "<u4"),
        ("code_and_position", "V2"),
        ("length", "u1"),
        ("padding", "V1"),
        ("bits", "<u4"),
        ("id", "<u4"),
        ("extended_flags", "<u2"),
        ("padding_2", "V2"),
        ("data", "u1", (MAX_DATA,)),
    ]
)


class BlfFile:
    """One BLF file that is being written; calls raise OSError.

    All containers but the last have `CONTAINER_FRAMES` frames, however often it was flushed: the
    same frames leave the same bytes.
    """

    def __init__(self, path: Path, channel: int) -> None:
        self._file = AppendedFile(path)
        self._channel = channel
        self._pending: list[Array] = []
        self._pending_frames = 0
        self._flushed_frames = 0  # those of the pending ones that are in the file
        self._objects = 0
        self._uncompressed = HEADER_SIZE
        try:
            self._file.append(self._header(0, 0, 0))
        except OSError:
            self._file.discard()
            raise

    def write(self, frames: Array) -> None:
        """Append frames; complete containers go into the file."""
        self._pending.append(frames.copy())
        self._pending_frames += len(frames)
        if self._pending_frames < CONTAINER_FRAMES:
            return
        frames = np.concatenate(self._pending)
        start = 0
        try:
            while len(frames) - start >= CONTAINER_FRAMES:
                container, uncompressed = self._container(frames[start : start + CONTAINER_FRAMES])
                self._file.append(container)
                self._flushed_frames = 0
                self._objects += CONTAINER_FRAMES
                self._uncompressed += uncompressed
                start += CONTAINER_FRAMES
        finally:
            self._pending = [frames[start:]]
            self._pending_frames = len(frames) - start
            if start:
                self._file.rewrite_head(self._header(0, 0, 0))

    def flush(self) -> None:
        """Put everything so far into the file."""
        if self._pending_frames == self._flushed_frames:
            return
        frames = np.concatenate(self._pending)
        self._pending = [frames]
        container, uncompressed = self._container(frames)
        self._file.put_tail(container)
        self._flushed_frames = len(frames)
        self._file.rewrite_head(self._header(len(container), uncompressed, len(frames)))

    def close(self) -> None:
        """Flush and close. Idempotent."""
        try:
            self.flush()
        finally:
            self._file.close()

    def discard(self) -> None:
        """Close and remove it."""
        self._file.discard()

    def _container(self, frames: Array) -> tuple[bytes, int]:
        """A container of frames, and its size uncompressed."""
        content = objects(frames, self._channel)
        packed = zlib.compress(content, _FAST)
        size = OBJECT_HEADER.size + CONTAINER.size + len(packed)
        container = (
            OBJECT_HEADER.pack(b"LOBJ", OBJECT_HEADER.size, 1, size, _CONTAINER_TYPE)
            + CONTAINER.pack(ZLIB, len(content))
            + packed
            + bytes(size % 4)
        )
        return container, OBJECT_HEADER.size + CONTAINER.size + len(content)

    def _header(self, tail: int, tail_uncompressed: int, tail_objects: int) -> bytes:
        """The file's header, with a tail of so many bytes and objects."""
        packed = _FILE_HEADER.pack(
            b"LOGG",
            HEADER_SIZE,
            *_APPLICATION,
            *_FORMAT_VERSION,
            max(self._file.size + tail, HEADER_SIZE),
            self._uncompressed + tail_uncompressed,
            self._objects + tail_objects,
            0,
            *_NO_DATE,
            *_NO_DATE,
        )
        return packed.ljust(HEADER_SIZE, b"\0")


def objects(frames: Array, channel: int) -> bytes:
    """The objects of frames, in their order."""
    is_error = frames["can_id"] & ERR != 0
    if not is_error.any():
        return _frame_objects(frames, channel).tobytes()
    # Runs of one kind each.
    borders = np.flatnonzero(is_error[1:] != is_error[:-1]) + 1
    return b"".join(
        (_error_objects if run["can_id"][0] & ERR else _frame_objects)(run, channel).tobytes()
        for run in np.split(frames, borders)
    )


def _frame_objects(frames: Array, channel: int) -> Array:
    made = np.zeros(len(frames), FRAME_OBJECT)
    _fill_head(made, frames, channel, FRAME_TYPE)
    can_id = frames["can_id"]
    remote = can_id & RTR != 0
    made["flags"] = remote * REMOTE | (frames["flags"] & _FROM_DRIVE == 0) * TRANSMITTED
    made["id"] = can_id & (EFF | ID_MASK_29)
    made["data"] = frames["data"]
    made["data"][remote] = 0
    return made


def _error_objects(frames: Array, channel: int) -> Array:
    made = np.zeros(len(frames), _ERROR_OBJECT)
    _fill_head(made, frames, channel, _ERROR_TYPE)
    made["id"] = frames["can_id"] & ID_MASK_29
    made["data"] = frames["data"]
    return made


def _fill_head(made: Array, frames: Array, channel: int, kind: int) -> None:
    made["signature"] = b"LOBJ"
    made["header_size"] = 32
    made["header_version"] = 1
    made["size"] = made.itemsize
    made["type"] = kind
    made["time_unit"] = _NANOSECONDS
    made["time"] = np.maximum(frames["stamp_ns"], 0)
    made["channel"] = channel
    made["length"] = np.minimum(frames["length"], MAX_DATA)
