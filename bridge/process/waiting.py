"""Waits for descriptors, to the microsecond where their numbers allow it."""

import math
import select
from collections.abc import Sequence
from typing import Protocol


class _HasDescriptor(Protocol):
    def fileno(self) -> int:
        """Its descriptor."""


def readable(files: Sequence[int | _HasDescriptor], within_s: float) -> bool:
    """Whether one of these becomes readable within a time.

    `select` alone counts in microseconds, but knows no number above 1023: a program that has so
    many files open waits in milliseconds.
    """
    try:
        return bool(select.select(files, [], [], within_s)[0])
    except ValueError:
        poller = select.poll()
        for file in files:
            poller.register(file, select.POLLIN)
        return bool(poller.poll(math.ceil(within_s * 1e3)))
