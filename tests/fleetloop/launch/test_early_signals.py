"""Ctrl-C before a run begins: an outcome, as at any other time."""

import json
import os
import signal

import pytest

from fleetloop.launch.run import RunOptions, run_scenario
from fleetloop.signals import deferred


@pytest.fixture(autouse=True)
def default_handlers():
    """What the command line has before a verb takes signals."""
    before = {it: signal.signal(it, signal.SIG_DFL) for it in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_signals_wait_while_they_are_deferred() -> None:
    with deferred() as came:
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)
    assert sorted(came) == [signal.SIGINT, signal.SIGTERM]
    assert signal.getsignal(signal.SIGINT) == signal.SIG_DFL


@pytest.mark.parametrize("form", ["as_json", "json_lines", ""])
def test_an_interrupted_start_has_an_outcome(form: str, capfd: pytest.CaptureFixture[str]) -> None:
    options = RunOptions(**({form: True} if form else {}))
    assert run_scenario("two_robots", options, interrupted=True) == 130
    out, err = capfd.readouterr()
    assert err == "two_robots: interrupted before it began\n"
    if form:
        said = json.loads(out)
        outcome = said["outcome"] if form == "json_lines" else said
        assert (outcome["verdict"], outcome["exit_status"]) == ("interrupted", 130)


def test_a_signal_during_the_check_is_an_outcome(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr("fleetloop.launch.run.prepare", interrupted)
    assert run_scenario("two_robots", RunOptions()) == 130
    assert "interrupted before it began" in capfd.readouterr().err
