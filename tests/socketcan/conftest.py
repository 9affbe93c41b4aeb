"""These tests need a kernel with CAN; elsewhere they are skipped, and `in_guest` runs them."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

INTERFACES = Path("/sys/class/net")


@pytest.fixture(scope="session")
def need() -> Callable[..., None]:
    """Skip a test where one of these network interfaces is missing."""

    def need_interfaces(*names: str) -> None:
        try:
            socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
        except (AttributeError, OSError):
            pytest.skip("this kernel has no CAN")
        absent = [name for name in names if not (INTERFACES / name).exists()]
        if absent:
            pytest.skip(f"no interface {', '.join(absent)}")
        if os.geteuid() != 0:
            pytest.skip("only root takes interfaces down")

    return need_interfaces
