"""A TCP way that takes its time and can be cut silently: no more bytes, and no end either."""

import contextlib
import heapq
import itertools
import select
import socket
import threading
import time


class CutProxy:
    """Forwards connections to a port on this machine, each way `delay_s` late, until it is cut."""

    def __init__(self, port: int, delay_s: float = 0.0) -> None:
        self._target, self._delay_s = port, delay_s
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._cut, self._over = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def cut(self) -> None:
        self._cut.set()

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def _serve(self) -> None:
        other: dict[socket.socket, socket.socket] = {}
        opened = [self._listener]
        late: list[tuple[float, int, socket.socket, bytes]] = []
        order = itertools.count()
        while not self._over.is_set():
            wait_s = 0.05 if not late else max(0.0, min(0.05, late[0][0] - time.monotonic()))
            sources = [] if self._cut.is_set() else [self._listener, *other]
            for source in select.select(sources, [], [], wait_s)[0]:
                if source is self._listener:
                    near, _ = source.accept()
                    far = socket.create_connection(("127.0.0.1", self._target))
                    for end in (near, far):
                        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    opened += (near, far)
                    other[near], other[far] = far, near
                    continue
                try:
                    data = source.recv(65536)
                except OSError:
                    data = b""
                heapq.heappush(
                    late, (time.monotonic() + self._delay_s, next(order), other[source], data)
                )
                if not data:
                    del other[source]
            while late and late[0][0] <= time.monotonic() and not self._cut.is_set():
                _, _, sink, data = heapq.heappop(late)
                with contextlib.suppress(OSError):
                    sink.sendall(data) if data else sink.shutdown(socket.SHUT_WR)
            if self._cut.is_set():
                self._over.wait(0.05)
        for end in opened:
            end.close()
