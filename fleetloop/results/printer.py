"""SVG and PDF files of figures, made by a process beside the one that makes all else of a report.

They take almost half of a report's processor time. The process gets figures on its standard input
and ends with it, and at once when whoever feeds it ends.

    python -m fleetloop.results.printer PARENT FOLDER   that process: pickled pairs (name, figure)
"""

import contextlib
import ctypes
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import IO, Self

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from configs.errors import FleetloopError, InfrastructureError
from fleetloop import packages
from fleetloop.results import run_folder
from fleetloop.results.drawing import STYLE
from fleetloop.results.pictures import picture

FORMATS = ("svg", "pdf")
LONGEST_S = 900.0
"""From the beginning to the end."""
_PR_SET_PDEATHSIG = 1
_FAILED = 3


class Printer:
    """Writes figures into a folder as `FORMATS`; a context manager: at its end all are there.

    Args:
        folder: it is there.

    Raises:
        InfrastructureError: the process can't be started, ended early, or a file can't be written.
    """

    def __init__(self, folder: Path) -> None:
        # -P: a folder here that is named like one of our packages must not shadow it. Its own
        # session: Ctrl-C reaches the caller, whose end is this one's.
        command = [sys.executable, "-P", "-m", __name__, str(os.getpid()), str(folder)]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                env=packages.environment(),
            )
        except OSError as error:
            raise InfrastructureError(f"can't start a process for figures: {error}") from error
        self._overdue = False
        self._bound = threading.Timer(LONGEST_S, self._give_up)
        self._bound.daemon = True
        self._bound.start()
        self._figures: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._feeder = threading.Thread(target=self._feed, name="figures", daemon=True)
        self._feeder.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if kind is not None:
            self._process.kill()
        said = self._end()
        if kind is None and self._process.returncode != 0:
            raise InfrastructureError(said)

    def print(self, name: str, figure: Figure) -> None:
        """Write a figure that is laid out, some time before the end; it may be changed then."""
        self._figures.put(pickle.dumps((name, figure)))

    def _feed(self) -> None:
        """Hand figures over, in a thread: the process takes them more slowly than they come."""
        with contextlib.suppress(BrokenPipeError):  # it has ended: told at the end
            for figure in iter(self._figures.get, None):
                if self._process.stdin is not None:
                    self._process.stdin.write(figure)

    def _give_up(self) -> None:
        """It took too long: whatever waits for it goes on."""
        self._overdue = True
        self._process.kill()

    def _end(self) -> str:
        """Wait for the end; what it said, or that it took too long."""
        self._figures.put(None)
        try:
            self._feeder.join()
            _, errors = self._process.communicate()
        except BaseException:  # Ctrl-C
            self._process.kill()
            self._process.communicate()
            raise
        finally:
            self._bound.cancel()
        if self._overdue:
            return f"SVG and PDF files took longer than {LONGEST_S:g} s"
        lines = errors.decode(errors="replace").splitlines()
        if self._process.returncode == _FAILED and lines:
            return lines[-1]
        last = f": {lines[-1]}" if lines else ""
        return f"the process for SVG and PDF files ended with {self._process.returncode}{last}"


def serve(folder: Path, figures: IO[bytes]) -> None:
    """Write all figures of a stream, to its end.

    Raises:
        InfrastructureError: a file can't be written.
    """
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        while True:
            try:
                name, figure = pickle.load(figures)
            except EOFError:
                return
            for form in FORMATS:
                run_folder.write(folder / f"{name}.{form}", picture(figure, form))


def main() -> int:
    """The process; its exit status."""
    parent, folder = sys.argv[1:]
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != int(parent):
        return _FAILED
    try:
        serve(Path(folder), sys.stdin.buffer)
    except FleetloopError as error:
        sys.stderr.write(f"{error}\n")
        return _FAILED
    except pickle.UnpicklingError:  # the caller was killed in the middle of a figure
        return _FAILED
    return 0


if __name__ == "__main__":
    sys.exit(main())
