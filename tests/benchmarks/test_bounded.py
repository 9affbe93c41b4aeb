"""Other people's programs are bounded, and neither a process nor a file of theirs is left."""

import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest

pytestmark = [pytest.mark.system, pytest.mark.timeout(60)]

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"

LEAVES_A_DAEMON = """
import os, signal, sys, tempfile
from pathlib import Path
Path("left behind").touch()
guard = os.getppid()
if os.fork() == 0:
    os.setsid()
    if os.fork():
        os._exit(0)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.close(1), os.close(2)
    fifo = os.open(sys.argv[1], os.O_WRONLY)
    os.write(fifo, f"{guard} {os.getpid()} {tempfile.gettempdir()}".encode())
    signal.pause()
os.wait()
os.read(os.open(sys.argv[1] + ".go", os.O_RDONLY), 1)
match sys.argv[2]:
    case "end": print("42.0")
    case "fail": sys.exit("no such broker")
    case "hang": signal.pause()
"""
"""In a session of its own, child of nobody, deaf to SIGTERM; then the program itself goes on."""

BENCHMARK = """
import sys
sys.path.insert(0, sys.argv[1])
from bounded import output_of
print("took", output_of([sys.executable, *sys.argv[3:]], float(sys.argv[2])))
"""


class Daemon:
    """What the program left: where it keeps its files, and whether it is still there."""

    def __init__(self, fifo: Path, reader: int, benchmark: "subprocess.Popen[str]") -> None:
        self.benchmark = benchmark
        assert select.select([reader], [], [], 20)[0], "the daemon never came up"
        guard, process, folder = os.read(reader, 4096).decode().split(maxsplit=2)
        self.folder = Path(folder)
        self._guard, self._process = os.pidfd_open(int(guard)), os.pidfd_open(int(process))
        go = os.open(f"{fifo}.go", os.O_WRONLY)
        os.write(go, b".")
        os.close(go)

    def is_gone(self) -> bool:
        """Within some seconds, the guard too."""
        watched = (self._process, self._guard)
        return all(select.select([process], [], [], 10)[0] for process in watched)

    def close(self) -> None:
        """Leave nothing behind if it is still there."""
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._process, signal.SIGKILL)
        os.close(self._guard)
        os.close(self._process)


@contextmanager
def daemon(folder: Path, then: str, limit_s: float = 30.0) -> Iterator[Daemon]:
    """A benchmark that runs the program."""
    fifo, program = folder / "fifo", folder / "program.py"
    os.mkfifo(fifo)
    os.mkfifo(f"{fifo}.go")
    program.write_text(LEAVES_A_DAEMON)
    reader = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
    command = [BENCHMARKS, str(limit_s), program, fifo, then]
    with subprocess.Popen(
        [sys.executable, "-c", BENCHMARK, *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as benchmark:
        try:
            with closing(Daemon(fifo, reader, benchmark)) as left:
                yield left
        finally:
            benchmark.kill()
            os.close(reader)


def test_a_daemon_in_another_session_ends_with_the_program_that_left_it(tmp_path: Path) -> None:
    with daemon(tmp_path, "end") as left:
        out, errors = left.benchmark.communicate(timeout=20)
        assert (out.split(), errors) == (["took", "42.0"], "")
        assert left.is_gone()
        assert not left.folder.exists()


def test_a_program_that_fails_ends_the_benchmark_with_its_errors(tmp_path: Path) -> None:
    with daemon(tmp_path, "fail") as left:
        out, errors = left.benchmark.communicate(timeout=20)
        assert left.benchmark.returncode == 1
        assert "took" not in out
        assert "no such broker" in errors
        assert left.is_gone()


def test_a_program_that_hangs_is_ended_after_its_time(tmp_path: Path) -> None:
    with daemon(tmp_path, "hang", limit_s=2.0) as left:
        _, errors = left.benchmark.communicate(timeout=20)
        assert left.benchmark.returncode == 1
        assert "not over within 2 s" in errors
        assert left.is_gone()
        assert not left.folder.exists()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_nothing_outlives_a_benchmark_that_is_killed(tmp_path: Path, how: signal.Signals) -> None:
    with daemon(tmp_path, "hang") as left:
        left.benchmark.send_signal(how)
        left.benchmark.communicate(timeout=20)
        assert left.is_gone()
        assert not left.folder.exists()
