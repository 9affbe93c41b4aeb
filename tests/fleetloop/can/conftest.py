"""Buses that are up in this process, for tools that join them by name."""

import threading
from collections.abc import Callable, Iterator

import pytest

from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub
from bridge.frame import Frame


class Buses:
    """Buses r1 and r2 of a run; a thread keeps them going."""

    def __init__(self) -> None:
        self.folder = sockets.create_run_folder("run")
        self.hub = Hub(sockets.listen(self.folder, ("r1", "r2")))
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._over.is_set():
            with self._lock:
                self.hub.collect(0.0)
            self._over.wait(0.001)

    def deliver(self, *frames: Frame, bus: str = "r1", stamp_ns: int = 1_000_000) -> None:
        with self._lock:
            self.hub.deliver(bus, stamp_ns, frames)

    def await_clients(self, count: int) -> None:
        assert self.until(lambda: self.hub.clients() >= count)

    def taken(self, count: int, bus: str = "r1") -> list[Frame]:
        """What clients sent, once `count` frames are there."""
        frames: list[Frame] = []

        def enough() -> bool:
            with self._lock:
                frames.extend(self.hub.receive(bus))
            return len(frames) >= count

        self.until(enough)
        return frames

    def until(self, holds: Callable[[], bool]) -> bool:
        """Whether a condition comes to hold within 10 s."""
        return any(holds() or self._over.wait(0.001) for _ in range(10_000))

    def end(self, reason: str = "end of the run") -> None:
        """What a run does when it ends."""
        if not self._over.is_set():
            self._over.set()
            self._thread.join()
            self.hub.close(reason)

    def close(self) -> None:
        self.end()
        sockets.remove_run_folder(self.folder)


@pytest.fixture
def in_background() -> Iterator[Callable[[Callable[[], object]], threading.Thread]]:
    """Run something in a thread that the test waits for in the end."""
    threads: list[threading.Thread] = []

    def start(work: Callable[[], object]) -> threading.Thread:
        threads.append(threading.Thread(target=work))
        threads[-1].start()
        return threads[-1]

    yield start
    for thread in threads:
        thread.join(20.0)
        assert not thread.is_alive()


@pytest.fixture
def buses(runtime_folder, in_background) -> Iterator[Buses]:
    buses = Buses()
    yield buses
    buses.close()
