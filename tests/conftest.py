"""Shared by all tests: a private folder for sockets, and scenarios as small as they can be."""

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
    with tempfile.TemporaryDirectory(prefix="fl-", dir="/tmp") as folder:
        monkeypatch.setenv("FLEETLOOP_RUNTIME", f"{folder}/r")
        yield Path(folder) / "r"
