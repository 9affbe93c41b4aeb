"""`fleetloop ps`: the runs of this user that go on on this machine, from their doors and locks.

A run that is starting has no door yet, and `fleetloop plant` alone has none.
"""

import contextlib
import os
from pathlib import Path
from typing import NamedTuple

from rich.table import Table

from bridge.can_bus import sockets
from bridge.process.kernel_stat import kernel_stat
from configs.errors import InfrastructureError
from fleetloop.door.client import CONNECT_S, RefusedError, RunClient, doors
from fleetloop.terminal import ResultConsole, note, say_json

NO_ANSWER, NO_DOOR = "no answer", "no door"


class GoingOn(NamedTuple):
    """One run; None: it doesn't say."""

    run: str
    scenario: str | None
    state: str
    """What `run.status` says; suspended by Ctrl-Z; no answer; or no door."""
    t_s: float | None
    pid: int  # of its launcher; 0: in another container
    folder: str | None


def going_on() -> list[GoingOn]:
    """All of them, in the order of their names."""
    found = []
    for client in doors():
        with client:
            found.append(_look_at(client))
    known = {one.run for one in found}
    for lock in sockets.trusted(f"*/{sockets.LOCK}"):
        run = lock.parent.name
        if run not in known and sockets.is_held(lock):
            pid = _holder(lock)
            state = "suspended" if _suspended(pid) else NO_DOOR
            found.append(GoingOn(run, None, state, None, pid, None))
    return sorted(found, key=lambda one: one.run)


def _look_at(client: RunClient) -> GoingOn:
    try:
        about = client.about()
    except (InfrastructureError, RefusedError):
        state = "suspended" if _suspended(client.pid) else NO_ANSWER
        return GoingOn(client.run, None, state, None, client.pid, None)
    return GoingOn(
        client.run, about.scenario, _state(client), about.t_s, client.pid, about.folder or None
    )


def _state(client: RunClient) -> str:
    try:
        return str(client.ask("run.status", within_s=CONNECT_S).get("state", "running"))
    except RefusedError:
        return "running"
    except InfrastructureError:
        return NO_ANSWER


def _holder(lock: Path, locks: Path = Path("/proc/locks")) -> int:
    """The process that holds a file's lock, as the kernel says; 0: one of another container."""
    with contextlib.suppress(OSError):
        status = lock.stat()
        device = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}"
        for line in locks.read_text("ascii").splitlines():
            _, kind, _, _, pid, place, *_ = line.split()
            if (kind, place) == ("FLOCK", f"{device}:{status.st_ino}"):
                return max(int(pid), 0)
    return 0


def _suspended(pid: int) -> bool:
    stat = kernel_stat(pid)
    return stat is not None and stat.state == "T"


def list_runs(*, as_json: bool) -> None:
    """Print them."""
    found = going_on()
    if as_json:
        say_json([one._asdict() for one in found])
    elif found:
        ResultConsole().print_whole(_table(found))
    else:
        note(f"no run goes on in {sockets.base_folder()}")


def _table(found: list[GoingOn]) -> Table:
    table = Table(box=None, header_style="dim", padding=(0, 1))
    for title in ("run", "scenario", "state", r"t \[s]", "pid", "folder"):
        table.add_column(
            title,
            justify="right" if title not in ("run", "scenario", "state", "folder") else "left",
        )
    for run, scenario, state, t_s, pid, folder in found:
        t = "-" if t_s is None else f"{t_s:.2f}"
        table.add_row(run, scenario or "-", state, t, str(pid or "-"), folder or "-")
    return table
