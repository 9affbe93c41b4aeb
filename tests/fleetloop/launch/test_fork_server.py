"""The fork server passes any number of descriptors, and tidies up after a killed launcher."""

import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

FORK = """
import json, os, resource, signal, socket, sys
from pathlib import Path
from fleetloop.launch.fork_server import ForkServer

resource.setrlimit(resource.RLIMIT_NOFILE, (1000, 1000))
given = [socket.socket(socket.AF_UNIX) for _ in range(300)]
inodes = [os.fstat(sock.fileno()).st_ino for sock in given]
brief, lifeline = os.pipe()
with ForkServer(Path(sys.argv[1]), batch=False) as server:
    forked = server.fork(sys.argv[2], brief, 1, [sock.fileno() for sock in given])
    running = Path(f"/proc/{forked.pid}/cmdline")
    while sys.argv[3].encode() not in running.read_bytes():
        os.sched_yield()
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

server = ForkServer(sockets.folder_of("run"), batch=False)
with sockets.run_folder("run") as folder:
    sockets.listen(folder, ("r1", "r2"))
    print(server._process.pid, flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize(
    ("module", "runs"),
    [("plant", "fork_server"), ("fleetloop.record.recorder", "fleetloop.record.recorder")],
)
def test_three_hundred_descriptors_arrive_in_order_under_a_limit_of_a_thousand(
    module: str, runs: str, tmp_path
) -> None:
    command = [sys.executable, "-c", FORK, str(tmp_path / "none"), module, runs]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    arrived, deaf_to_ctrl_c = json.loads(done.stdout or "[false, false]")
    assert arrived, done.stderr
    assert deaf_to_ctrl_c


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_folder_of_a_launcher_that_was_killed_goes(
    number: signal.Signals, runtime_folder: Path
) -> None:
    launcher = subprocess.Popen(
        [sys.executable, "-c", ASK], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert launcher.stdin is not None
    assert launcher.stdout is not None
    with launcher, launcher.stdin, launcher.stdout:
        server = os.pidfd_open(int(launcher.stdout.readline()))
        assert (runtime_folder / "run" / "r2.can").is_socket()
        launcher.send_signal(number)
        launcher.wait(10.0)
        assert select.select([server], [], [], 20.0)[0], "the fork server is still there"
    os.close(server)
    assert not runtime_folder.exists()
