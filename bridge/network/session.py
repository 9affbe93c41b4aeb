"""Zenoh sessions: configuration, opening within a bound, lifetime.

Client mode, multicast and gossip off, so that all messages pass the router; shared memory off. Each
session has few threads: a message that wakes one instead of five costs half as much. A router has
separate threads for receiving and sending, so that a client that doesn't read can't stop the rest.
"""

import contextlib
import ctypes
import json
import os
import threading
from collections.abc import Iterator, Mapping
from typing import TypeVar

import zenoh

from bridge.network import zenoh_log
from bridge.network.connections import never_linger
from bridge.network.packing import MAX_BYTES
from configs.tls import TlsFiles

ONE_THREAD = (
    "(app: (worker_threads: 1), net: (handover: app), acc: (handover: app), rx: (handover: app),"
    " tx: (handover: app))"
)
ROUTER_THREADS = (
    "(app: (worker_threads: 1), net: (handover: app), acc: (handover: rx),"
    " rx: (worker_threads: 2), tx: (worker_threads: 1))"
)
"""What accepts a connection is told of all that comes on it: where others read, one more thread is
woken by every message."""
WAIT_BEFORE_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
_Kept = TypeVar("_Kept")


def common(mode: str, lease_s: float) -> dict[str, object]:
    """What all sessions have in common, by path in Zenoh's configuration.

    `mode` is "client", "peer" or "router".
    """
    return {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "transport/shared_memory/enabled": False,
        "transport/link/rx/max_message_size": 2 * MAX_BYTES,
        "transport/link/tx/lease": int(lease_s * 1e3),
    }


def config_of(settings: Mapping[str, object]) -> zenoh.Config:
    """Zenoh's configuration with these settings, by path."""
    zenoh_log.begin()
    config = zenoh.Config()
    for path, value in settings.items():
        set_key(config, path, value)
    return config


def set_key(config: zenoh.Config, path: str, value: object) -> None:
    """Set one key of Zenoh's configuration."""
    config.insert_json5(path, json.dumps(value))


def mutual_tls(files: TlsFiles, side: str) -> dict[str, object]:
    """Zenoh's TLS section; `side` is "listen" or "connect"."""
    return {
        "root_ca_certificate": str(files.ca),
        "enable_mtls": True,
        f"{side}_certificate": str(files.certificate),
        f"{side}_private_key": str(files.private_key),
    }


@contextlib.contextmanager
def few_threads(threads: str) -> Iterator[None]:
    """Around the first session of a process: Zenoh reads it then, and children don't inherit it."""
    if "ZENOH_RUNTIME" in os.environ:
        yield
        return
    os.environ["ZENOH_RUNTIME"] = threads
    try:
        yield
    finally:
        os.environ.pop("ZENOH_RUNTIME", None)  # another thread may be opening one as well


def open_bounded(config: zenoh.Config, timeout_s: float) -> zenoh.Session | str:
    """A session, or why there is none; "" if that took too long.

    Opened in a thread of its own: a peer that accepts and never answers would hang it. A session
    that opens later than that is closed.
    """
    result: list[zenoh.Session | str] = []
    lock = threading.Lock()
    waiting = True

    def open_session() -> None:
        try:
            session = keep(zenoh.open(config))
            keep(never_linger(session))
            opened: zenoh.Session | str = session
        except zenoh.ZError as error:
            opened = str(error)
        with lock:
            if waiting:
                result.append(opened)
                return
        if not isinstance(opened, str):
            opened.close()

    opener = threading.Thread(target=open_session, daemon=True)
    opener.start()
    opener.join(timeout_s)
    with lock:
        waiting = False
    return result[0] if result else ""


def keep(thing: _Kept) -> _Kept:
    """Never deallocate it: no list or module may own it, for those end before the process does.

    To deallocate a session, open or closed, is to wait with the GIL held for a task of Zenoh's,
    and Zenoh's only thread may wait for the GIL at that moment to call another session back: every
    thread of the process would stop for ever. Whatever drops the last reference does it, a garbage
    collection of an old exception's traceback in any thread too. A session that was closed costs
    20 kB.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))
    return thing
