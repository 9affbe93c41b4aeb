"""Shared by all tests: a private folder for sockets, signals as children expect them."""

import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# The tests' own process runs the sources, whose classes a test may derive from; what it starts runs
# what is installed. First of all imports of ours. With FLEETLOOP_PURE=0 it runs what is installed.
_PURE = os.environ.get("FLEETLOOP_PURE")
os.environ["FLEETLOOP_PURE"] = _PURE or "1"
import configs.compiled  # noqa: E402, F401

if _PURE is None:
    del os.environ["FLEETLOOP_PURE"]
else:
    os.environ["FLEETLOOP_PURE"] = _PURE

pytest_plugins = ("support.browser", "support.wall_clock", "support.workers")

# In the background of a script, or under nohup, these are ignored, and all children inherit that.
# A handler, even one that does nothing, is theirs no longer: they begin with the default.
for _number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, lambda *_: None)

settings.register_profile("fleetloop", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("fleetloop")


@pytest.fixture(autouse=True)
def runtime_folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Sockets of this test only; the path is short, as Unix sockets need it."""
    short = "/tmp" if os.access("/tmp", os.W_OK) else tempfile.gettempdir()
    with tempfile.TemporaryDirectory(prefix="fl-", dir=short) as folder:
        monkeypatch.setenv("FLEETLOOP_RUNTIME", f"{folder}/r")
        yield Path(folder) / "r"
