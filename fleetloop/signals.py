"""Ctrl-C, SIGTERM and a closed terminal: as a request for an orderly stop, or as an exception."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import FrameType
from typing import ParamSpec, TypeVar

from bridge.process.lifecycle import Stop

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Signals ask for an orderly stop while this lasts; under `nohup` a closed terminal doesn't."""
    stop = Stop()

    def request(number: int, _: FrameType | None) -> None:
        stop.request(f"interrupted by {signal.Signals(number).name}")

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, request) for number in numbers}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def limited(seconds: float, what: str) -> Iterator[None]:
    """Raise `TimeoutError`, in the words of `what`, within code that takes longer than so long.

    Of Python, in the main thread; a call into C ends first. Elsewhere there is no limit.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(_: int, __: FrameType | None) -> None:
        raise TimeoutError(f"{what}: not done within {seconds:g} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def deferred() -> Iterator[list[int]]:
    """Ctrl-C and SIGTERM only put their numbers into a list while this lasts: for imports."""
    came: list[int] = []
    before = {
        number: signal.signal(number, lambda which, _: came.append(which))
        for number in (signal.SIGINT, signal.SIGTERM)
        if signal.getsignal(number) is not signal.SIG_IGN
    }
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def interruptible(verb: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Ctrl-C and SIGTERM raise `KeyboardInterrupt` while this verb runs."""

    @wraps(verb)
    def run(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        before = {}
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                if signal.getsignal(number) is not signal.SIG_IGN:
                    before[number] = signal.signal(number, signal.default_int_handler)
        try:
            return verb(*args, **kwargs)
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    return run
