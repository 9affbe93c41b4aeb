"""Unix sockets of the buses of all runs on this machine, in private folders.

    <base>/<run>/<bus>.can              base: $FLEETLOOP_RUNTIME, else $XDG_RUNTIME_DIR/fleetloop,
    <base>/<run>/.fleetloop-lock              else /tmp/fleetloop-<uid>

A channel is named by its bus ("r1"), by run and bus ("20261123-101500-paper/r1") or by the path of
its socket. Sockets without a listener are ignored.

The base must belong to this user: another writer could pretend to be a bus. The launcher of a run
holds its lock, so the leftovers of a killed run are known, and removed when the next one starts.
"""

import contextlib
import fcntl
import os
import socket
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from configs.errors import InfrastructureError

SUFFIX = ".can"
LOCK = ".fleetloop-lock"
MAX_PATH_BYTES = 107
_BACKLOG = 4096


class NoSuchBusError(InfrastructureError):
    """A channel names no live bus, or more than one."""


def base_folder() -> Path:
    """The folder that holds one folder per live run; absolute."""
    if named := os.environ.get("FLEETLOOP_RUNTIME"):
        return Path(named).absolute()
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    if runtime.startswith("/"):  # others are to be ignored, says the standard
        return Path(runtime) / "fleetloop"
    return Path(f"/tmp/fleetloop-{os.getuid()}")


def folder_of(run: str) -> Path:
    """The folder of a run, whether it exists or not."""
    return base_folder() / run


@contextlib.contextmanager
def run_folder(run: str) -> Iterator[Path]:
    """The private folder of a run while it lives; first removes what killed runs left.

    Raises:
        InfrastructureError: as `create_run_folder`.
    """
    _sweep(base_folder())
    folder = folder_of(run)
    lock = _locked(folder) or _locked(folder) or _locked(folder)
    if lock is None:
        raise InfrastructureError(f"{folder} is taken away again and again")
    try:
        yield folder
    finally:
        remove_run_folder(folder)
        os.close(lock)


def _locked(folder: Path) -> int | None:
    """Make a run's folder and hold its lock; None if another start took it for left over."""
    create_run_folder(folder.name)
    with contextlib.suppress(FileNotFoundError):
        lock = os.open(folder / LOCK, os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
        if (folder / LOCK).exists():
            return lock
        os.close(lock)
    return None


def create_run_folder(run: str) -> Path:
    """Make the private folder of a run.

    Raises:
        InfrastructureError: it can't be made, exists already, or the base isn't safe.
    """
    folder = folder_of(run)
    base = folder.parent
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        if danger := _danger(base):
            raise InfrastructureError(f"{base} {danger}")
        folder.mkdir(mode=0o700)
    except OSError as error:
        raise InfrastructureError(
            f"can't make the run's folder for sockets {folder}: {error.strerror};"
            " FLEETLOOP_RUNTIME names another place for it"
        ) from error
    return folder


def _danger(base: Path) -> str:
    """Why others could pretend to be our buses, "" if they can't."""
    status = base.lstat()
    if stat.S_ISLNK(status.st_mode):
        return "is a symbolic link; set FLEETLOOP_RUNTIME to a folder itself"
    if status.st_uid != os.getuid():
        return f"belongs to user {status.st_uid}; set FLEETLOOP_RUNTIME to a folder of your own"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        mode = stat.S_IMODE(status.st_mode)
        return f"can be written by others (mode {mode:04o}); chmod 700 {base}"
    return ""


def _sweep(base: Path) -> None:
    """Remove the folders of runs whose lock is free and whose buses have no listener."""
    for path in base.glob(f"*/{LOCK}"):
        with contextlib.suppress(OSError), path.open() as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not any(_answers(bus) for bus in path.parent.glob(f"*{SUFFIX}")):
                remove_run_folder(path.parent)


def is_held(lock: Path) -> bool:
    """Whether a launcher holds the lock of its run; one that has gone again isn't."""
    try:
        with lock.open() as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


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
        if len(os.fsencode(path)) > MAX_PATH_BYTES:
            raise InfrastructureError(
                f"the socket path {path} is longer than {MAX_PATH_BYTES} bytes; set"
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
    with contextlib.suppress(OSError):
        # The lock last: what is interrupted here is still known as left over.
        for leftover in sorted(folder.iterdir(), key=lambda path: path.name == LOCK):
            leftover.unlink(missing_ok=True)
    for empty in (folder, folder.parent):
        with contextlib.suppress(OSError):
            empty.rmdir()


def live_buses() -> list[Path]:
    """The sockets of all buses with a listener, in order of their names."""
    return [path for path in trusted(f"*/*{SUFFIX}") if _answers(path)]


def trusted(pattern: str) -> list[Path]:
    """The files of a pattern below the base, in order of their names; none if it isn't safe."""
    base = base_folder()
    with contextlib.suppress(OSError):
        if not _danger(base):
            return sorted(base.glob(pattern))
    return []


def find(channel: str) -> Path:
    """The socket that a channel names.

    Raises:
        NoSuchBusError: none, or several runs have a bus of that name; the text lists what there is.
    """
    if channel.startswith("/"):
        return Path(channel)
    base = base_folder()
    if base.exists() and (danger := _danger(base)):
        raise NoSuchBusError(f"no bus {channel!r} to be trusted: {base} {danger}")
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
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except BlockingIOError:
            return True  # its queue of pending connections is full
        except OSError:
            return False
    return True
