"""Frames of a BLF file as an array, of files as `fleetloop.record.blf` writes them.

A file that was cut is read up to its last whole container; error frames are left out.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fleetloop.record.blf import (
    CONTAINER,
    FRAME_OBJECT,
    FRAME_TYPE,
    HEADER_SIZE,
    OBJECT_HEADER,
    ZLIB,
    Array,
)

_SIZE_AND_TYPE = struct.Struct("<4sHHLL")


def read_frames(path: Path) -> Array:
    """The data and remote frames of a file, in their order: fields of `blf.FRAME_OBJECT`.

    Raises:
        OSError: the file can't be read.
        ValueError: it is no BLF file.
    """
    data = path.read_bytes()
    if data[:4] != b"LOGG":
        raise ValueError(f"{path}: no BLF file")
    blocks = [_frames(content) for content in _containers(data)]
    return np.concatenate([np.empty(0, FRAME_OBJECT), *blocks])


def _containers(data: bytes) -> Iterator[bytes]:
    """The contents of all whole containers."""
    at = HEADER_SIZE
    head = OBJECT_HEADER.size + CONTAINER.size
    while at + head <= len(data):
        signature, _, _, size, _ = OBJECT_HEADER.unpack_from(data, at)
        method, _ = CONTAINER.unpack_from(data, at + OBJECT_HEADER.size)
        if signature != b"LOBJ" or size <= head or at + size > len(data):
            return
        packed = data[at + head : at + size]
        try:
            yield zlib.decompress(packed) if method == ZLIB else packed
        except zlib.error:
            return
        at += size + size % 4


def _frames(content: bytes) -> Array:
    if len(content) % FRAME_OBJECT.itemsize == 0:
        found = np.frombuffer(content, FRAME_OBJECT)
        if (found["signature"] == b"LOBJ").all() and (found["type"] == FRAME_TYPE).all():
            return found
    return np.frombuffer(b"".join(_objects(content)), FRAME_OBJECT)


def _objects(content: bytes) -> Iterator[bytes]:
    """The frames among objects of several types."""
    at = 0
    while at + _SIZE_AND_TYPE.size <= len(content):
        signature, _, _, size, kind = _SIZE_AND_TYPE.unpack_from(content, at)
        if signature != b"LOBJ" or size < _SIZE_AND_TYPE.size:
            return
        if kind == FRAME_TYPE and size == FRAME_OBJECT.itemsize == len(content[at : at + size]):
            yield content[at : at + size]
        at += size
