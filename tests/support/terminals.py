"""Streams that are terminals."""

import io
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout

import pytest


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True


@contextmanager
def as_terminal(
    monkeypatch: pytest.MonkeyPatch,
    *,
    term: str = "xterm",
    stdout: io.StringIO | None = None,
    stderr: io.StringIO | None = None,
) -> Iterator[None]:
    """Have these streams, and the environment of a terminal of 80 by 24."""
    for name, value in (("TERM", term), ("COLUMNS", "80"), ("LINES", "24")):
        monkeypatch.setenv(name, value)
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    with ExitStack() as streams:
        if stdout is not None:
            streams.enter_context(redirect_stdout(stdout))
        if stderr is not None:
            streams.enter_context(redirect_stderr(stderr))
        yield
