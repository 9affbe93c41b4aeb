"""Zenoh's log: configured once per process, read by the router through file descriptor 1.

    RUST_LOG=info fleetloop run ...    as usual for programs with Zenoh, but to standard error

While a router is open the descriptor is a pipe. A thread reads it for refusals by the router and
forwards all other lines to the previous target of the descriptor.
"""

import contextlib
import fcntl
import os
import re
import sys
import threading
from collections.abc import Callable, Iterator

import zenoh

_PIPE_BYTES = 1 << 20
_PAUSE_S = 0.02
"""Between reads: many lines at a time cost less, and no writer waits for the reader."""
_ZENOHS = re.compile(rb"\d{4}-\d\d-\d\dT[\d:.]+Z +[A-Z]+ ")
_begun = threading.Lock()


def begin(directives: str = "") -> None:
    """Begin the log of this process with what RUST_LOG asks for, and `directives`; once."""
    if not _begun.acquire(blocking=False):
        return
    asked = os.environ.get("RUST_LOG")
    before = {name: os.environ.get(name) for name in ("RUST_LOG", "NO_COLOR")}
    if directives:
        os.environ["RUST_LOG"] = f"{asked},{directives}" if asked else directives
        os.environ["NO_COLOR"] = "1"
    try:
        zenoh.init_log_from_env_or("off")
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextlib.contextmanager
def listening(process: Callable[[str], None], is_ours: Callable[[str], bool]) -> Iterator[None]:
    """Call `process`, in a thread of its own, with every line of the log until the end.

    Lines go on to standard error if RUST_LOG is set, but for those that are ours.
    """
    _flush()
    before = os.dup(1)
    out, into = os.pipe()
    with contextlib.suppress(OSError):
        fcntl.fcntl(into, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    os.dup2(into, 1)
    ours = os.fstat(into).st_ino
    os.close(into)
    over = threading.Event()
    reader = threading.Thread(target=_read, args=(out, before, over, process, is_ours), daemon=True)
    reader.start()
    try:
        yield
    finally:
        _flush()
        with contextlib.suppress(OSError):  # closed meanwhile
            if os.fstat(1).st_ino == ours:  # not redirected meanwhile
                os.dup2(before, 1)
        over.set()
        reader.join(1.0)
        if not reader.is_alive():
            os.close(before)


def _read(
    out: int,
    before: int,
    over: threading.Event,
    process: Callable[[str], None],
    is_ours: Callable[[str], bool],
) -> None:
    asked = bool(os.environ.get("RUST_LOG"))
    rest = b""
    while chunk := os.read(out, _PIPE_BYTES):
        *lines, rest = (rest + chunk).split(b"\n")
        for line in lines:
            if not _ZENOHS.match(line):
                _write(before, line)
                continue
            if b" is authorized to " not in line:
                process(line.decode("utf-8", "replace"))
            if asked and not is_ours(line.decode("utf-8", "replace")):
                _write(2, line)
        over.wait(_PAUSE_S)
    if rest:
        _write(before, rest)
    os.close(out)


def _write(descriptor: int, line: bytes) -> None:
    with contextlib.suppress(OSError):
        os.write(descriptor, line + b"\n")


def _flush() -> None:
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
