"""A log as `candump -L -x` writes it, made of whole blocks of frames in numpy.

    (0000000012.345678) r1 009#0000803F00000000 R

Every line is laid out in the same columns of bytes; a mask says which of them the frame has (an
11-bit identifier three of eight digits, n bytes of data 2 n of 16, and so on), and what the mask
leaves is the text. `R`: from a drive, `T`: sent by a host.
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, MAX_DATA, RTR
from fleetloop.record.append import AppendedFile

KEPT_BYTES = 256 * 1024
_FROM_DRIVE = 1
_HEX = np.frombuffer(b"0123456789ABCDEF", np.uint8)
_BYTES = np.stack([np.repeat(_HEX, 16), np.tile(_HEX, 16)], axis=1)  # two digits of every byte
_FOUR_DIGITS = np.frombuffer("".join(f"{n:04}" for n in range(10_000)).encode(), np.uint8).reshape(
    -1, 4
)
_NIBBLES = np.arange(28, -1, -4, dtype=np.uint32)

Array = npt.NDArray[Any]


class CandumpLog:
    """One log that is being written; calls raise OSError."""

    def __init__(self, path: Path, name: str) -> None:
        self._file = AppendedFile(path)
        self._name = name
        self._kept = bytearray()

    def write(self, frames: Array) -> None:
        """Append frames; whole lines go into the file once there are enough."""
        self._kept += lines(frames, self._name)
        if len(self._kept) >= KEPT_BYTES:
            self.flush()

    def flush(self) -> None:
        """Put everything so far into the file."""
        if self._kept:
            self._file.append(bytes(self._kept))
            self._kept.clear()

    def close(self) -> None:
        """Flush and close. Idempotent."""
        try:
            self.flush()
        finally:
            self._file.close()

    def discard(self) -> None:
        """Close and remove it."""
        self._file.discard()


def lines(frames: Array, name: str) -> bytes:
    """The lines of frames."""
    label = np.frombuffer(f") {name} ".encode(), np.uint8)
    can_id = frames["can_id"]
    is_error = can_id & ERR != 0
    remote = (can_id & RTR != 0) & ~is_error
    wide = (can_id & EFF != 0) | is_error
    length = np.minimum(frames["length"], MAX_DATA)

    identifier = np.where(wide, can_id & ID_MASK_29, can_id & ID_MASK_11)
    identifier |= np.where(is_error, np.uint32(ERR), np.uint32(0))
    id_digits = _HEX[identifier[:, None] >> _NIBBLES & 0xF]
    id_kept = np.ones(id_digits.shape, bool)
    id_kept[:, :5] = wide[:, None]
    data_digits = _BYTES[frames["data"]].reshape(len(frames), 2 * MAX_DATA)
    data_kept = np.arange(2 * MAX_DATA) < (2 * length * ~remote)[:, None]
    remote_digits = np.stack([np.full(len(frames), ord("R"), np.uint8), _HEX[length]], axis=1)
    remote_kept = np.stack([remote, remote & (length > 0)], axis=1)
    direction = np.where(frames["flags"] & _FROM_DRIVE, ord("R"), ord("T")).astype(np.uint8)

    parts: list[tuple[Array, Array | None]] = [
        (_stamps(frames["stamp_ns"]), None),
        (np.broadcast_to(label, (len(frames), len(label))), None),
        (id_digits, id_kept),
        (_column(frames, "#"), None),
        (data_digits, data_kept),
        (remote_digits, remote_kept),
        (_column(frames, " "), None),
        (direction[:, None], None),
        (_column(frames, "\n"), None),
    ]
    rows = np.concatenate([part for part, _ in parts], axis=1)
    kept = np.concatenate(
        [np.ones(part.shape, bool) if mask is None else mask for part, mask in parts], axis=1
    )
    text: bytes = rows[kept].tobytes()
    return text


def _stamps(stamp_ns: Array) -> Array:
    """`(` and ten digits of seconds, a point, six of microseconds, cut off as candump does."""
    seconds, rest_ns = np.divmod(np.maximum(stamp_ns, 0), 1_000_000_000)
    micros = rest_ns // 1000
    text = np.empty((len(stamp_ns), 18), np.uint8)
    text[:, 0] = ord("(")
    text[:, 1:3] = _FOUR_DIGITS[seconds // 100_000_000 % 100][:, 2:]
    text[:, 3:7] = _FOUR_DIGITS[seconds // 10_000 % 10_000]
    text[:, 7:11] = _FOUR_DIGITS[seconds % 10_000]
    text[:, 11] = ord(".")
    text[:, 12:14] = _FOUR_DIGITS[micros // 10_000][:, 2:]
    text[:, 14:18] = _FOUR_DIGITS[micros % 10_000]
    return text


def _column(frames: Array, character: str) -> Array:
    return np.full((len(frames), 1), ord(character), np.uint8)
