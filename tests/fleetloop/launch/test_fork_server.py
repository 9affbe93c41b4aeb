"""The fork server passes any number of descriptors, and tidies up after a killed launcher."""

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from configs.roles import STARTED
from fleetloop.launch.fork_server import imports_begun

FORK = """
import json, os, resource, signal, socket, sys
from pathlib import Path
from fleetloop.launch.fork_server import ForkServer

resource.setrlimit(resource.RLIMIT_NOFILE, (1000, 1000))
given = [socket.socket(socket.AF_UNIX) for _ in range(300)]
inodes = [os.fstat(sock.fileno()).st_ino for sock in given]
brief, lifeline = os.pipe()
with ForkServer() as server:
    server.serve(Path(sys.argv[1]), lockstep=False)
    forked = server.fork(sys.argv[2], brief, 1, [sock.fileno() for sock in given])
    blocked = Path(f"/proc/{forked.pid}/status").read_text().partition("SigBlk:")[2].split()[0]
    there = [os.stat(f"/proc/{forked.pid}/fd/{fd}").st_ino for fd in forked.fds]
os.close(brief)
os.close(lifeline)
os.waitpid(forked.pid, 0)
print(json.dumps([there == inodes, int(blocked, 16) >> (signal.SIGINT - 1) & 1]))
"""
ASK = """
import os, sys
from pathlib import Path
from bridge.can_bus import sockets
from fleetloop.launch.fork_server import ForkServer

server = ForkServer()
server.serve(sockets.folder_of("run"), lockstep=False)
with sockets.run_folder("run") as folder:
    sockets.listen(folder, ("r1", "r2"))
    print(*(one.process.pid for one in server._servers), flush=True)
    sys.stdin.read()
"""
BEGIN = """
import sys
from fleetloop.launch.fork_server import ForkServer

server = ForkServer()
print(*(one.process.pid for one in server._servers), flush=True)
sys.stdin.read()
"""


@contextmanager
def launcher(program: str, number: signal.Signals) -> Iterator[list[int]]:
    """Its fork servers, as descriptors; at the end it is killed, and they have to end."""
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        servers = [os.pidfd_open(int(pid)) for pid in process.stdout.readline().split()]
        try:
            yield servers
        finally:
            process.send_signal(number)
            process.wait(10.0)
            for server in servers:
                assert select.select([server], [], [], 20.0)[0], "a fork server is still there"
                with suppress(ChildProcessError):  # this process may be who adopts orphans
                    os.waitid(os.P_PIDFD, server, os.WEXITED)
                os.close(server)


@pytest.mark.parametrize("module", [role.module for role in STARTED])
def test_three_hundred_descriptors_arrive_in_order_under_a_limit_of_a_thousand(
    module: str, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", FORK, str(tmp_path / "none"), module]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    arrived, deaf_to_ctrl_c = json.loads(done.stdout or "[false, false]")
    assert arrived, done.stderr
    assert deaf_to_ctrl_c


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_folder_of_a_launcher_that_was_killed_goes(
    number: signal.Signals, runtime_folder: Path
) -> None:
    with launcher(ASK, number):
        assert (runtime_folder / "run" / "r2.can").is_socket()
    assert not runtime_folder.exists()


def test_fork_servers_that_no_run_uses_end_at_once() -> None:
    with imports_begun(wanted=True) as server:
        assert server is not None
        processes = [one.process for one in server._servers]
        assert all(process.poll() is None for process in processes)
    assert [process.returncode for process in processes] == [-signal.SIGKILL] * 2


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_fork_servers_end_with_a_launcher_that_never_said_what_they_serve(
    number: signal.Signals,
) -> None:
    with launcher(BEGIN, number) as servers:
        assert len(servers) == 2


def test_a_package_that_is_not_ours_is_refused_before_it_is_imported(tmp_path: Path) -> None:
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents" / "__init__.py").write_text("")
    told = tmp_path / "imported"
    (tmp_path / "agents" / "__main__.py").write_text(f"open({str(told)!r}, 'w')")
    command = [sys.executable, "-c", "from fleetloop.launch.fork_server import *; ForkServer()"]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60
    )
    assert f"the package 'agents' found at {tmp_path / 'agents'}" in done.stderr
    assert not told.exists()
