"""A role on another machine that follows its launcher: there, away, over."""

import threading
from collections.abc import Callable

import pytest

from bridge.network import keys
from bridge.network.launcher import LauncherWatch
from bridge.network.reports import LauncherReport
from bridge.process.lifecycle import LAUNCHER_GONE, Stop
from configs.connections import NetworkLink


class Line:
    """What a watch listens to, said by the test."""

    def __init__(self) -> None:
        self.hear: Callable[[bytes], None] = lambda _: None
        self.note: Callable[[str, bool], None] = lambda *_: None

    def each(self, key: str, act: Callable[[bytes], None]) -> None:
        assert key == keys.report("lab", "launcher")
        self.hear = act

    def each_live(self, key: str, act: Callable[[str, bool], None]) -> None:
        assert key == keys.live("lab", "launcher")
        self.note = act


def watching(rejoin_s: float) -> tuple[Line, LauncherWatch, Stop]:
    line, stop = Line(), Stop()
    network = NetworkLink("lab", "", "agent-r1", "", rejoin_s=rejoin_s)
    return line, LauncherWatch(line, network, stop), stop


def test_without_leave_to_rejoin_a_launcher_that_is_gone_is_the_end() -> None:
    line, _, stop = watching(0.0)
    line.note("", True)
    assert not stop.requested
    line.note("", False)
    assert stop.reason == LAUNCHER_GONE


def test_who_may_rejoin_is_away_and_there_again() -> None:
    line, watch, stop = watching(60.0)
    line.note("", True)
    assert not watch.away
    line.note("", False)
    assert watch.away
    assert not stop.requested
    line.note("", True)
    assert not watch.away


@pytest.mark.timeout(20)
def test_who_is_away_for_too_long_ends() -> None:
    line, _, stop = watching(0.01)
    line.note("", True)
    line.note("", False)
    while not stop.requested:
        threading.Event().wait(0.005)
    assert stop.reason == LAUNCHER_GONE


def test_the_last_word_of_the_launcher_is_the_reason() -> None:
    line, _, stop = watching(60.0)
    line.hear(b"\xc1")
    assert not stop.requested
    line.hear(LauncherReport("a robot left").encode())
    assert stop.reason == "the run was ended: a robot left"
