"""Where a run's buses live: Unix sockets in a private folder.

    <base>/<run>/<bus>.can        base: $FLEETLOOP_RUNTIME, else $XDG_RUNTIME_DIR/fleetloop,
                                  else /tmp/fleetloop-<uid>

A channel is named by its bus ("r1"), by run and bus ("20261123-101500-paper/r1") or by the path of
its socket. Sockets that nobody listens on any more are no buses.
"""

import contextlib
import os
import socket
from collections.abc import Iterable
from pathlib import Path

from configs.errors import InfrastructureError

SUFFIX = ".can"
_MAX_PATH_BYTES = 107
_BACKLOG = 64


class NoSuchBusError(InfrastructureError):
    """A channel names no live bus, or more than one."""


def base_folder() -> Path:
    """The folder that holds one folder per live run."""
    if named := os.environ.get("FLEETLOOP_RUNTIME"):
        return Path(named)
    if runtime := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(runtime) / "fleetloop"
    return Path(f"/tmp/fleetloop-{os.getuid()}")


def create_run_folder(run: str) -> Path:
    """Make the private folder of a run.

    Raises:
        InfrastructureError: it can't be made, exists already, or the base is somebody else's.
    """
    base = base_folder()
    folder = base / run
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        owner = base.stat().st_uid
        if owner != os.getuid():
            raise InfrastructureError(
                f"{base} belongs to user {owner}; set FLEETLOOP_RUNTIME to a folder of your own"
            )
        folder.mkdir(mode=0o700)
    except OSError as error:
        raise InfrastructureError(f"can't make the run's folder for sockets: {error}") from error
    return folder


def socket_path(folder: Path, bus: str) -> Path:
    """The socket of a bus in a run's folder."""
    return folder / f"{bus}{SUFFIX}"


def listen(folder: Path, buses: Iterable[str]) -> dict[str, socket.socket]:
    """Bind and listen on a socket per bus.

    Raises:
        InfrastructureError: a socket is taken, its path is too long, or the folder isn't writable.
    """
    paths = {bus: socket_path(folder, bus) for bus in buses}
    for path in paths.values():
        if len(os.fsencode(path)) > _MAX_PATH_BYTES:
            raise InfrastructureError(
                f"the socket path {path} is longer than {_MAX_PATH_BYTES} bytes; set"
                " FLEETLOOP_RUNTIME to a shorter folder"
            )
    sockets: dict[str, socket.socket] = {}
    try:
        for bus, path in paths.items():
            sockets[bus] = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            sockets[bus].bind(str(path))
            sockets[bus].listen(_BACKLOG)
    except OSError as error:
        for opened in sockets.values():
            opened.close()
        raise InfrastructureError(f"can't open bus {bus} at {path}: {error.strerror}") from error
    return sockets


def remove_run_folder(folder: Path) -> None:
    """Remove a run's folder and its sockets, and the base when it is empty. Idempotent."""
    if not folder.is_dir():
        return
    for leftover in folder.iterdir():
        leftover.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        folder.rmdir()
    with contextlib.suppress(OSError):
        folder.parent.rmdir()


def live_buses() -> list[Path]:
    """The sockets of all buses that somebody listens on, in order of their names."""
    base = base_folder()
    return [path for path in sorted(base.glob(f"*/*{SUFFIX}")) if _answers(path)]


def find(channel: str) -> Path:
    """The socket that a channel names.

    Raises:
        NoSuchBusError: none, or several runs have a bus of that name; the text lists what there is.
    """
    if channel.startswith("/"):
        return Path(channel)
    buses = live_buses()
    run, _, bus = channel.rpartition("/")
    matches = [
        path for path in buses if path.name == bus + SUFFIX and run in ("", path.parent.name)
    ]
    if len(matches) == 1:
        return matches[0]
    names = ", ".join(name_of(path) for path in matches or buses) or "none"
    if matches:
        raise NoSuchBusError(f"bus {channel!r} is on several runs: name one of {names}")
    raise NoSuchBusError(f"no bus {channel!r} is up; buses up now: {names}")


def name_of(path: Path) -> str:
    """The channel name of a socket that no other live bus shares: run/bus."""
    return f"{path.parent.name}/{path.name.removesuffix(SUFFIX)}"


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        probe.settimeout(0.2)
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True
