"""Shared by all tests: a private folder for sockets, and scenarios as small as they can be."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("fleetloop", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("fleetloop")


@pytest.fixture(autouse=True)
def runtime_folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Sockets of this test only; the path is short, as Unix sockets need it."""
    short = "/tmp" if os.access("/tmp", os.W_OK) else tempfile.gettempdir()
    with tempfile.TemporaryDirectory(prefix="fl-", dir=short) as folder:
        monkeypatch.setenv("FLEETLOOP_RUNTIME", f"{folder}/r")
        yield Path(folder) / "r"
