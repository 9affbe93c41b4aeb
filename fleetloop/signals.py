"""Ctrl-C, SIGTERM and a closed terminal, as a request for an orderly stop."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from bridge.process import Stop


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Signals ask for an orderly stop while this lasts."""
    stop = Stop()

    def request(number: int, _: FrameType | None) -> None:
        stop.request(f"interrupted by {signal.Signals(number).name}")

    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, request) for number in numbers}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
