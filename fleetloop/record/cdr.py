"""Messages in CDR (little endian), many at once: a template whose numbers are filled in.

Messages of one template have the same strings and sequences of the same lengths, so that they
differ only in times and in some float64, at the same places in each. CDR aligns a number to its
size, counted from behind the 4 bytes of the encapsulation header, so float64 are words of 8 bytes.
(OMG DDSI-RTPS 2.5, section 10: the plain CDR that ROS 2 writes.)
"""

import struct
from typing import NamedTuple

import numpy as np

HEADER = b"\x00\x01\x00\x00"
"""Encapsulation: CDR, little endian."""


class Template(NamedTuple):
    """Messages up to their variable numbers."""

    words: np.ndarray
    """The constant bytes [u8], filled up to whole words."""
    length: int
    """Of a message [bytes], without the encapsulation header."""
    numbers: np.ndarray
    """Words in which the variable float64 stand, in the order in which they were laid."""
    stamps: np.ndarray
    """Half words of 4 bytes in which the variable times begin."""

    def filled(self, times_ns: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """The bytes of messages, one per row, without encapsulation headers.

        Args:
            times_ns: of each message.
            numbers: a row for each message, a column for each variable float64.
        """
        words = np.empty((len(times_ns), len(self.words)), "<u8")
        words[:] = self.words
        words[:, self.numbers] = np.ascontiguousarray(numbers, "<f8").view("<u8")
        halves = words.view("<u4")
        halves[:, self.stamps] = (times_ns // 1_000_000_000)[:, None]
        halves[:, self.stamps + 1] = (times_ns % 1_000_000_000)[:, None]
        return words.view("u1")[:, : self.length]


class Layer:
    """Lays a template, field by field in the order of its schema."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._numbers: list[int] = []
        self._stamps: list[int] = []

    def uint8(self, value: int) -> None:
        """A constant uint8, or a bool."""
        self._bytes.append(value)

    def uint32(self, value: int) -> None:
        """A constant uint32, such as the length of a sequence."""
        self._align(4)
        self._bytes += struct.pack("<I", value)

    def string(self, text: str) -> None:
        """A constant string."""
        data = text.encode() + b"\0"
        self.uint32(len(data))
        self._bytes += data

    def float64(self, *values: float) -> None:
        """Constant float64."""
        self._align(8)
        self._bytes += struct.pack(f"<{len(values)}d", *values)

    def variable(self, count: int = 1) -> None:
        """So many float64 that are filled in."""
        self._align(8)
        first = len(self._bytes) // 8
        self._numbers += range(first, first + count)
        self._bytes += bytes(8 * count)

    def duration(self, nanoseconds: int) -> None:
        """A constant builtin_interfaces/Duration, or a Time."""
        self.uint32(nanoseconds // 1_000_000_000)
        self.uint32(nanoseconds % 1_000_000_000)

    def stamp(self) -> None:
        """A builtin_interfaces/Time that is filled in: the message's."""
        self._align(4)
        self._stamps.append(len(self._bytes) // 4)
        self._bytes += bytes(8)

    def template(self) -> Template:
        """The template."""
        length = len(self._bytes)
        padded = bytes(self._bytes) + bytes(-length % 8)
        return Template(
            np.frombuffer(padded, "<u8"),
            length,
            np.array(self._numbers, np.intp),
            np.array(self._stamps, np.intp),
        )

    def _align(self, size: int) -> None:
        self._bytes += bytes(-len(self._bytes) % size)
