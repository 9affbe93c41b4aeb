"""A hub in this process, and clients of its buses on its machine and on another one."""

from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
from support.hub_running import Running
from support.strangers import Serving


@pytest.fixture(params=["local", "remote"])
def where(request: pytest.FixtureRequest) -> str:
    """Clients on the hub's machine, and on another one: the same contract."""
    return request.param


@pytest.fixture
def running(where: str, runtime_folder, tmp_path: Path) -> Iterator[Running]:
    running = Running(tmp_path if where == "remote" else None)
    yield running
    running.close()


@pytest.fixture
def join(running: Running) -> Iterator[Callable[..., can.BusABC]]:
    buses: list[can.BusABC] = []

    def open_bus(channel: str = "r1", **options) -> can.BusABC:
        settings = running.remote.settings() if running.remote is not None else {}
        bus = can.Bus(interface="fleetloop", channel=channel, **settings, **options)
        buses.append(bus)
        return bus

    yield open_bus
    for bus in buses:
        bus.shutdown()


@pytest.fixture
def serving(runtime_folder) -> Iterator[Serving]:
    serving = Serving()
    yield serving
    serving.close()
