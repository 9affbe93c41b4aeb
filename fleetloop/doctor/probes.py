"""What is so on this machine: measured and asked for, judged elsewhere. Linux only.

Each probe leaves everything as it was, takes at most a few milliseconds, but for `wake_ups`, and
fails for no file that isn't there.
"""

import contextlib
import os
import platform
import resource
import shutil
import socket
from collections.abc import Iterator
from importlib.metadata import entry_points, version
from pathlib import Path

from bridge.can_bus import sockets
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.kernel_stat import kernel_stat
from configs.errors import InfrastructureError
from fleetloop.doctor.judgement import WakeUps
from fleetloop.launch.fork_server import refuse_shadowed_roles

PRIORITY = 40
"""As a controller's."""
_CAN_TYPE = "280"
"""ARPHRD_CAN."""
_TITLE = b"fleetloop "
_ROLES = ("agent ", "plant", "recorder", "viewer")


def wake_ups(period_s: float, lasting_s: float, clock: Clock = SYSTEM_CLOCK) -> WakeUps:
    """Sleep until absolute times, one period after the other; how late each wake-up was."""
    late_s = []
    due_s = clock.monotonic_s() + period_s
    for _ in range(max(round(lasting_s / period_s), 1)):
        now_s = clock.monotonic_s()
        if due_s > now_s:
            clock.sleep(due_s - now_s)
        late_s.append(max(clock.monotonic_s() - due_s, 0.0))
        due_s += period_s * (1 + int(late_s[-1] / period_s))  # what is overdue is skipped
    return WakeUps(sorted(late_s), period_s)


@contextlib.contextmanager
def realtime_priority() -> Iterator[bool]:
    """Have the priority of a controller meanwhile, if that is allowed; gives whether it is."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, policy, parameters)


def limit(which: int) -> int:
    """The hard limit of a resource, -1 if there is none."""
    hard = resource.getrlimit(which)[1]
    return -1 if hard == resource.RLIM_INFINITY else hard


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0))


def text_of(path: str) -> str | None:
    """The first line of a file of the kernel, None if there is none."""
    try:
        return Path(path).read_text("ascii", "replace").split("\n")[0].strip()
    except OSError:
        return None


def loopback_problem() -> str:
    """Why a router can't listen on 127.0.0.1, "" if it can."""
    try:
        with socket.create_server(("127.0.0.1", 0)) as server:
            socket.create_connection(server.getsockname(), timeout=2.0).close()
    except OSError as error:
        return f"can't listen on 127.0.0.1: {error.strerror or error}"
    return ""


def bus_problem() -> str:
    """Why the bus of a run can't be made, "" if it can."""
    base = sockets.base_folder()
    there = base.exists()
    try:
        folder = sockets.create_run_folder(f"doctor-{os.getpid()}")
    except InfrastructureError as error:
        return str(error)
    try:
        for made in sockets.listen(folder, ["r1"]).values():
            made.close()
    except InfrastructureError as error:
        return str(error)
    finally:
        sockets.remove_run_folder(folder)
        if there:
            base.mkdir(mode=0o700, exist_ok=True)
    return ""


def dead_runs() -> list[str]:
    """Folders of sockets whose run is gone."""
    locks = sockets.trusted(f"*/{sockets.LOCK}")
    return [path.parent.name for path in locks if not sockets.is_held(path)]


def lone_roles(proc: Path = Path("/proc")) -> list[tuple[int, str]]:
    """Processes of this user with the title of a role whose parent is the first process."""
    found = []
    for folder in proc.glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError):
            title = (folder / "cmdline").read_bytes().rstrip(b"\0")
            name = title.removeprefix(_TITLE).decode("utf-8", "replace")
            if not title.startswith(_TITLE) or not name.startswith(_ROLES):
                continue
            if (stat := kernel_stat(int(folder.name), proc)) is None:
                continue
            status = (folder / "status").read_text("ascii", "replace")
            uid = next(it.split()[1] for it in status.splitlines() if it.startswith("Uid:"))
            if int(uid) == os.getuid() and (stat.parent == 1 or _is_init(proc / str(stat.parent))):
                found.append((int(folder.name), name))
    return sorted(found)


def _is_init(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        return (folder / "comm").read_text("utf-8", "replace").strip() in ("systemd", "init")
    return False


def can_interfaces(classes: Path = Path("/sys/class/net")) -> list[str]:
    """SocketCAN interfaces, up or down."""
    return sorted(
        path.parent.name for path in classes.glob("*/type") if text_of(str(path)) == _CAN_TYPE
    )


def can_modules() -> list[str]:
    """The kernel's CAN modules that are loaded."""
    return [
        name for name in ("can", "can_raw", "vcan", "slcan") if Path("/sys/module", name).is_dir()
    ]


def registered() -> bool:
    """Whether python-can finds our interface."""
    return any(point.name == "fleetloop" for point in entry_points(group="can.interface"))


def versions() -> list[tuple[str, str]]:
    """Of what counts."""
    ours = [(name, version(name)) for name in ("fleetloop", "eclipse-zenoh", "python-can")]
    return [*ours, ("Python", platform.python_version())]


def package_problem() -> str:
    """Why processes would load what isn't ours, "" if they wouldn't."""
    try:
        refuse_shadowed_roles()
    except InfrastructureError as error:
        return str(error)
    return ""


def place_of_runs() -> Path:
    """Where `fleetloop run` puts its folders: the nearest one that is there."""
    try:
        runs = Path("runs").absolute()
    except FileNotFoundError:  # the folder in which this runs was removed
        return Path("runs")
    return next(path for path in (runs, *runs.parents) if path.exists())


def free_bytes(folder: Path) -> int | None:
    """Space for this user's files, None if it can't write there."""
    if not os.access(folder, os.W_OK | os.X_OK):
        return None
    with contextlib.suppress(OSError):
        return shutil.disk_usage(folder).free
    return None
