"""Hosts on this machine: network namespaces on a switch whose links can be slow, lossy and cut.

Every host has one interface, a tap device; this process forwards the frames between them. Needs
root, iproute2 and /dev/net/tun.
"""

import contextlib
import fcntl
import heapq
import itertools
import os
import random
import selectors
import struct
import subprocess
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

_TUNSETIFF, _IFF_TAP, _IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
_LONGEST_FRAME = 1 << 16


def allowed() -> bool:
    """Whether this user may make such hosts."""
    if os.geteuid() or not os.access("/dev/net/tun", os.R_OK | os.W_OK):
        return False
    name = f"fl{os.getpid()}probe"
    try:
        made = subprocess.run(["ip", "netns", "add", name], capture_output=True).returncode == 0
    except FileNotFoundError:
        return False
    if made:
        ip("netns", "del", name)
    return made


def ip(*args: str) -> None:
    subprocess.run(["ip", *args], check=True, capture_output=True, timeout=20)


@dataclass
class Host:
    """One namespace and its link to the switch."""

    namespace: str
    address: str
    delay_s: float = 0.0
    """Of each frame, each way."""
    loss: float = 0.0
    """Share of the frames that are lost, each way."""
    cut: bool = False
    """Frames are lost without a word, both ways."""
    tap: int = field(default=-1, repr=False)

    @property
    def exec(self) -> Sequence[str]:
        """Words before a command that runs on it."""
        return ("ip", "netns", "exec", self.namespace)


class Switch:
    """Forwards frames between hosts, in a thread of its own."""

    def __init__(self, hosts: Sequence[Host], seed: int = 1) -> None:
        self._hosts = hosts
        self._random = random.Random(seed)
        self._places: dict[bytes, Host] = {}  # by address of the interface
        self._late: list[tuple[float, int, Host, bytes]] = []
        self._order = itertools.count()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join(5.0)

    def _serve(self) -> None:
        with selectors.DefaultSelector() as selector:
            for host in self._hosts:
                selector.register(host.tap, selectors.EVENT_READ, host)
            while not self._over.is_set():
                for key, _ in selector.select(self._deliver()):
                    with contextlib.suppress(BlockingIOError):
                        self._forward(key.data, os.read(key.fd, _LONGEST_FRAME))

    def _forward(self, sender: Host, frame: bytes) -> None:
        self._places[frame[6:12]] = sender
        to = None if frame[0] & 1 else self._places.get(frame[:6])
        for host in [to] if to else self._hosts:
            if host is sender or self._lost(sender) or self._lost(host):
                continue
            due_s = time.monotonic() + sender.delay_s + host.delay_s
            heapq.heappush(self._late, (due_s, next(self._order), host, frame))

    def _lost(self, host: Host) -> bool:
        return host.cut or self._random.random() < host.loss

    def _deliver(self) -> float:
        """Deliver what is due; return how long until the next is."""
        while self._late and self._late[0][0] <= time.monotonic():
            _, _, host, frame = heapq.heappop(self._late)
            if not host.cut:
                with contextlib.suppress(OSError):
                    os.write(host.tap, frame)
        return max(self._late[0][0] - time.monotonic(), 0.0) if self._late else 0.05


@contextlib.contextmanager
def hosts(*names: str) -> Iterator[list[Host]]:
    """These hosts, reachable from each other at their addresses."""
    made: list[Host] = []
    switch: Switch | None = None
    try:
        for number, name in enumerate(names, 1):
            host = Host(f"fl{os.getpid()}{name}", f"10.77.0.{number}")
            ip("netns", "add", host.namespace)
            made.append(host)
            host.tap = _tap(f"fl{os.getpid() % 10**6}t{number}", host)
        switch = Switch(made)
        yield made
    finally:
        if switch is not None:
            switch.close()
        for host in made:
            if host.tap >= 0:
                os.close(host.tap)
            ip("netns", "del", host.namespace)


def _tap(device: str, host: Host) -> int:
    """The switch's end of the only interface of a host."""
    tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    fcntl.ioctl(tap, _TUNSETIFF, struct.pack("16sH22x", device.encode(), _IFF_TAP | _IFF_NO_PI))
    inside = ("-n", host.namespace)
    ip("link", "set", device, "netns", host.namespace, "name", "eth0")
    for words in ("link set lo up", f"addr add {host.address}/24 dev eth0", "link set eth0 up"):
        ip(*inside, *words.split())
    return tap
