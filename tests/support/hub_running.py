"""A hub that a thread keeps going while clients wait for it, and guests' way to it over Zenoh."""

import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import can

from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub
from bridge.can_bus.relay import Relay
from bridge.frame import Frame
from bridge.network import access
from bridge.network.router import open_router

RUN = "test"
GRANTED = {"bench": ("r1",), "boss": ("*",)}
WORDS = {"bench": "agreed", "boss": "secret"}


def lost_at(hub: Hub, bus: str) -> int:
    """Frames that clients of a bus did not read in time."""
    return int(hub.troubles()[bus].split(" frames for clients were lost")[0])


class Remote:
    """A router with its relay, and how a guest opens a bus through it."""

    def __init__(self, folder: Path) -> None:
        plan = access.plan(
            RUN, ("r1", "r2"), {"r1": (), "r2": ()}, ("r1",), guests=WORDS, bus_guests=GRANTED
        )
        self._stack = ExitStack()
        self.link = self._stack.enter_context(open_router(None, plan, folder))
        run_folder = sockets.base_folder() / RUN
        self.relay = self._stack.enter_context(Relay(self.link, run_folder, ("r1", "r2"), GRANTED))

    def settings(self, user: str = "boss") -> dict[str, str]:
        return {"endpoint": self.link.endpoint, "user": user, "password": WORDS.get(user, "")}

    def close(self) -> None:
        self._stack.close()


class Running:
    """A hub with the buses r1 and r2, in a thread; `folder`: over Zenoh as well."""

    def __init__(self, folder: Path | None = None) -> None:
        self.hub = Hub(sockets.listen(sockets.create_run_folder(RUN), ("r1", "r2")))
        self.lock = threading.Lock()  # whoever holds it stops the hub
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()
        self.remote = Remote(folder) if folder is not None else None

    def _serve(self) -> None:
        while not self._over.is_set():
            with self.lock:
                for _ in range(10):
                    self.hub.collect(0.0)
            self._over.wait(0.001)

    @property
    def endpoint(self) -> str:
        """Where those on other machines come in."""
        assert self.remote is not None
        return self.remote.link.endpoint

    def open(self, channel: str = "r1", user: str = "bench", **options) -> can.BusABC:
        """A bus from another machine."""
        assert self.remote is not None
        settings = self.remote.settings(user) | {"connect_timeout": 5.0} | options
        return can.Bus(interface="fleetloop", channel=channel, **settings)

    def deliver(self, *frames: Frame, bus: str = "r1", stamp_ns: int = 1_000_000) -> None:
        with self.lock:
            self.hub.deliver(bus, stamp_ns, frames)

    def taken(self, count: int, bus: str = "r1") -> list[Frame]:
        """What clients sent, once `count` frames are there."""
        frames: list[Frame] = []
        for _ in range(5000):
            with self.lock:
                frames += self.hub.receive(bus)
            if len(frames) >= count:
                break
            self._over.wait(0.001)
        return frames

    def until(self, what: Callable[[], object]) -> bool:
        """Whether it becomes true within five seconds."""
        for _ in range(5000):
            with self.lock:
                if what():
                    return True
            self._over.wait(0.001)
        return False

    def close(self, reason: str = "the test is over") -> None:
        if self._over.is_set():
            return
        self._over.set()
        self._thread.join()
        self.hub.close(reason)
        if self.remote is not None:
            self.remote.close()
        sockets.remove_run_folder(sockets.base_folder() / RUN)
