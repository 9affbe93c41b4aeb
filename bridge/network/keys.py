"""Zenoh keys of a run, one function each; stable parts left.

    fleetloop/<run>/robot/<name>/path        s, v̂_r, t; heard by exactly the out-neighbours
    fleetloop/<run>/robot/<name>/silence     from the plant: no path state of it at a tick
    fleetloop/<run>/robot/<name>/pose        from the localisation system to the robot
    fleetloop/<run>/robot/<name>/truth       the plant's rows, to viewers, and a recorder elsewhere
    fleetloop/<run>/robot/<name>/telemetry   the controller's rows, likewise
    fleetloop/<run>/robot/<name>/inputs      the controller's input log, to a recorder elsewhere
    fleetloop/<run>/can/<bus>/traffic        what crosses a bus, to a recorder elsewhere
    fleetloop/<run>/leader/speed             v_r; heard by the robots with h_i = 1
    fleetloop/<run>/@live/<process>          liveliness token: "ready"
    fleetloop/<run>/@clock/go                from the launcher to plant and controllers
    fleetloop/<run>/@clock/ping              what is the time? from the launcher
    fleetloop/<run>/@pong/<process>          the time of a process on another machine, to it
    fleetloop/<run>/@progress/<process>      how far a process is, to the launcher
    fleetloop/<run>/@notice/<process>        what has just happened, in words, to the launcher
    fleetloop/<run>/@report/<process>        a process's last word, to the launcher
    fleetloop/<run>/@order/<process>         faults to apply or to end, to the process
    fleetloop/<run>/@answer/<process>        a process's answer to orders, to the launcher
    fleetloop/@guest/<user>/<line>/<bus>/..  a client of a bus on another machine: up, down, alive;
                                             <run>/<bus> if it names the run as well
    fleetloop/@guest/<user>/@relay           liveliness token: the relay serves this user

A recorder on the same machine has a socket of each process (`bridge.network.row_socket`).

A process is `launcher`, `plant`, `recorder` or `agent/<robot>`. Chunks that begin with @ are
verbatim: no wildcard of data subscriptions matches them.
"""

import re

from configs.errors import ScenarioError

_CHUNK = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]*")


def path(run: str, robot: str) -> str:
    """Key of a robot's path variable."""
    return f"{_run(run)}/robot/{_chunk(robot)}/path"


def silence(run: str, robot: str) -> str:
    """Key on which the plant says that a robot has no path state."""
    return f"{_run(run)}/robot/{_chunk(robot)}/silence"


def pose(run: str, robot: str) -> str:
    """Key of a robot's pose, from the localisation system."""
    return f"{_run(run)}/robot/{_chunk(robot)}/pose"


def truth(run: str, robot: str) -> str:
    """Key of the plant's record of a robot."""
    return f"{_run(run)}/robot/{_chunk(robot)}/truth"


def traffic(run: str, bus: str) -> str:
    """Key of the frames of a bus."""
    return f"{_run(run)}/can/{_chunk(bus)}/traffic"


def telemetry(run: str, robot: str) -> str:
    """Key of a controller's record."""
    return f"{_run(run)}/robot/{_chunk(robot)}/telemetry"


def inputs(run: str, robot: str) -> str:
    """Key of a controller's input log."""
    return f"{_run(run)}/robot/{_chunk(robot)}/inputs"


def leader_speed(run: str) -> str:
    """Key of the virtual leader's speed."""
    return f"{_run(run)}/leader/speed"


def go(run: str) -> str:
    """Key of the start message."""
    return f"{_run(run)}/@clock/go"


def ping(run: str) -> str:
    """Key of the launcher's question for the time."""
    return f"{_run(run)}/@clock/ping"


def pong(run: str, process: str) -> str:
    """Key of a process's answer to it."""
    return f"{_run(run)}/@pong/{_process(process)}"


def live(run: str, process: str) -> str:
    """Liveliness token of a process."""
    return f"{_run(run)}/@live/{_process(process)}"


def progress(run: str, process: str) -> str:
    """Key of a process's progress."""
    return f"{_run(run)}/@progress/{_process(process)}"


def notice(run: str, process: str) -> str:
    """Key of a process's notices."""
    return f"{_run(run)}/@notice/{_process(process)}"


def report(run: str, process: str) -> str:
    """Key of a process's final report."""
    return f"{_run(run)}/@report/{_process(process)}"


def order(run: str, process: str) -> str:
    """Key of orders to a process."""
    return f"{_run(run)}/@order/{_process(process)}"


def answer(run: str, process: str) -> str:
    """Key of a process's answers to orders."""
    return f"{_run(run)}/@answer/{_process(process)}"


def guest_line(user: str, line: str, channel: str) -> str:
    """Key of a guest's connection to a bus or run/bus; its keys end in up, down and alive."""
    run, _, bus = channel.rpartition("/")
    chunks = (user, line, run, bus) if run else (user, line, bus)
    return f"fleetloop/@guest/{'/'.join(_chunk(chunk) for chunk in chunks)}"


def guest_lines(end: str, user: str) -> str:
    """All lines of a guest."""
    return f"fleetloop/@guest/{_chunk(user)}/**/{end}"


def guest_relay(user: str) -> str:
    """Liveliness token of the relay that serves a guest."""
    return f"fleetloop/@guest/{_chunk(user)}/@relay"


def guest_of(place: str) -> tuple[str, str] | None:
    """The user and the channel, a bus or run/bus, of a guest's connection; None: another key."""
    chunks = place.split("/")
    if len(chunks) not in (5, 6) or not all(map(_CHUNK.fullmatch, chunks[2:])):
        return None
    return chunks[2], "/".join(chunks[4:])


def kind(key: str) -> str:
    """Kind of message on a key: path, pose, truth, ...; of the control plane progress, report."""
    chunks = key.split("/")
    plane = chunks[2]
    return plane[1:] if plane.startswith("@") else chunks[-1]


def process_of(key: str) -> str:
    """The process that a key of the control plane speaks of."""
    return key.split("/", 3)[3]


def _run(run: str) -> str:
    return f"fleetloop/{_chunk(run)}"


def _process(process: str) -> str:
    return "/".join(_chunk(chunk) for chunk in process.split("/"))


def _chunk(name: str) -> str:
    if not _CHUNK.fullmatch(name):
        raise ScenarioError(
            f"{name!r} can't be part of a Zenoh key: letters, digits, and _ . + - after the first"
        )
    return name
