"""Progress on a terminal, on one that can't move its cursor, and where there is none."""

import io
from contextlib import redirect_stderr

import pytest
from support.robot_states import robot
from support.terminals import Screen, as_terminal

from fleetloop.terminal import Bars, RunProgress, note, say


@pytest.fixture
def screen(monkeypatch):
    """A terminal, and the environment of one."""
    with as_terminal(monkeypatch):
        yield Screen()


def go(stream: io.StringIO, *, quiet: bool = False) -> str:
    """What is said of a run to a standard error."""
    with redirect_stderr(stream), RunProgress("paper", 10.0, quiet=quiet) as progress:
        progress.robots = lambda: [robot("r1"), robot("r2", phase="stopped")]
        progress.show(1.0, 0.5)
        progress.notice("r2: stopped")
    return stream.getvalue()


def test_on_a_terminal_a_bar_moves_with_a_row_per_robot_under_it(screen: Screen) -> None:
    said = go(screen)
    assert said.index("paper: starting") < said.index("2.0 × real time") < said.index("r1 ")
    assert "\x1b[1;31mr2 " in said  # a stopped one is seen
    assert "\x1b[33mr2: stopped" in said
    assert said.endswith("\x1b[2K")  # nothing of the bar stays


def test_what_others_say_meanwhile_comes_above_the_bar(screen: Screen) -> None:
    with redirect_stderr(screen), RunProgress("paper", 10.0) as progress:
        progress.show(1.0, 0.5)
        note("something else")
    assert "something else\n" in screen.getvalue()


def test_results_on_standard_output_are_no_part_of_it(screen: Screen, capsys) -> None:
    with redirect_stderr(screen), RunProgress("paper", 10.0) as progress:
        progress.show(1.0, 0.5)
        say("a result")
    assert capsys.readouterr().out == "a result\n"
    assert "a result" not in screen.getvalue()


@pytest.mark.parametrize("term", ["dumb", "unknown"])
def test_a_terminal_that_cannot_move_its_cursor_is_told_lines(
    screen: Screen, monkeypatch, term: str
) -> None:
    monkeypatch.setenv("TERM", term)
    assert go(screen) == "paper: 1.00 / 10 s  2.0 × real time\nr2: stopped\n"


def test_a_log_is_told_lines(monkeypatch) -> None:
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    monkeypatch.delenv("TTY_COMPATIBLE", raising=False)
    assert go(io.StringIO()) == "paper: 1.00 / 10 s  2.0 × real time\nr2: stopped\n"


def test_quiet_is_all_but_what_happens(screen: Screen) -> None:
    assert go(screen, quiet=True) == "r2: stopped\n"


def test_a_name_is_no_markup(screen: Screen) -> None:
    with redirect_stderr(screen), RunProgress("[bold]x[/bold]", 10.0):
        pass
    assert "[bold]x[/bold]: starting" in screen.getvalue()
    assert issubclass(RunProgress, Bars)
