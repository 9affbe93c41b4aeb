"""The viewer of one run: a process that the launcher starts when it is asked for it.

    request          arguments     answer
    live.open        -             url: of the page, once it listens; the same at the next time
    live.listening   token, url    -: the viewer itself says where its page is

It takes no part in the run: its end is a notice, after which it may be asked for again. It outlives
the run until its summary is written, which it shows.
"""

import contextlib
import os
import secrets
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

from bridge.process.lifecycle import Status, pack_brief
from configs.brief import ViewerBrief
from configs.errors import InfrastructureError, ScenarioError
from configs.roles import VIEWER
from fleetloop import packages
from fleetloop.door.requests import Request, Respond

NICE = 10
"""Of all its threads, which start after it is set: a tenth of the processor of what it competes
with, which is about what a page needs."""
PATIENCE = 3.0
"""Times the deadline of a start: it is waited for so long, as it yields the processor."""
STOP_S = 2.0
"""From letting go of it until it is killed."""


class Viewer:
    """Starts and ends the viewer.

    Args:
        brief: of its token; None: this run can have no viewer.
        start_deadline_s: of the processes of a run [s].
        note: told what is to be said of it at once.
        now_s: seconds on the launcher's clock of awake time.
    """

    def __init__(
        self,
        brief: Callable[[str], ViewerBrief | None],
        start_deadline_s: float,
        note: Callable[[str], None],
        now_s: Callable[[], float],
    ) -> None:
        self._brief = brief
        self._start_deadline_s = PATIENCE * start_deadline_s
        self._note = note
        self._now_s = now_s
        self._process: subprocess.Popen[bytes] | None = None
        self._token = self._url = ""
        self._listens = False
        self._asking: list[Respond] = []
        self._deadline_s = 0.0
        self.requests: Mapping[str, Request] = {
            "live.open": Request({}, self._open),
            "live.listening": Request({"token": str, "url": str}, self._listening),
        }

    def open(self) -> None:
        """Start it, and note where its page is once it listens.

        Raises:
            ScenarioError: this run can have none.
            InfrastructureError: its process can't be had.
        """
        self._open(self._tell)

    def look(self) -> None:
        """Notice its end, and a page that doesn't come to listen."""
        process = self._process
        if process is None:
            return
        if process.poll() is not None:
            self._ended(process)
        elif self._asking and self._now_s() > self._deadline_s:
            self._answer({"error": f"the viewer: no page within {self._start_deadline_s:g} s"})
            self.close()

    def stop(self) -> None:
        """Tell it that no rows follow; it stays until `close`."""
        if self._process is not None:
            self._process.send_signal(signal.SIGTERM)

    def close(self) -> None:
        """End its process within a bound; the summary of the run is written. Idempotent."""
        process, self._process = self._process, None
        if process is None:
            return
        # Closing waits for a brief that isn't read yet.
        threading.Thread(target=_let_go, args=(process,), daemon=True).start()
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._forget(process)

    # --- requests --------------------------------------------------------------------------------

    def _open(self, respond: Respond) -> None:
        if self._process is None:
            self._start()
        if self._listens:
            respond({"url": self._url})
        else:
            self._asking.append(respond)

    def _listening(self, respond: Respond, token: str, url: str) -> None:
        if self._process is None or not secrets.compare_digest(
            token.encode(), self._token.encode()
        ):
            raise ScenarioError("live.listening: not this run's viewer")
        self._url, self._listens = url, True
        respond({})
        self._answer({"url": url})

    # --- process ---------------------------------------------------------------------------------

    def _start(self) -> None:
        token = secrets.token_urlsafe(24)
        brief = self._brief(token)
        if brief is None:
            raise ScenarioError("live.open: the router of this run is a program of its own")
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", VIEWER.module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
                env=packages.environment(),
            )
        except OSError as error:
            raise InfrastructureError(f"can't start the viewer: {error.strerror}") from error
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        _yield_processor(process.pid)
        self._process, self._token = process, token
        self._deadline_s = self._now_s() + self._start_deadline_s
        # It reads once it has imported its libraries; the launcher doesn't wait for that.
        threading.Thread(target=_hand_over, args=(process, brief), daemon=True).start()

    def _tell(self, answer: Mapping[str, str]) -> None:
        if "error" in answer:
            self._note(answer["error"])
        elif answer["url"]:
            self._note(answer["url"])

    def _answer(self, answer: dict[str, str]) -> None:
        asking, self._asking = self._asking, []
        for respond in asking:
            respond({**answer})

    def _ended(self, process: subprocess.Popen[bytes]) -> None:
        """Say that it has ended, and why."""
        self._process = None
        lines = process.stdout.read().splitlines() if process.stdout is not None else []
        said = [status for line in lines if (status := Status.from_line(line)) is not None]
        code = process.returncode
        why = said[-1].error if said else _how(code)
        text = f"the viewer has ended: {why}; the run goes on without it"
        if self._asking:
            self._answer({"error": text})
        else:
            self._note(text)
        self._forget(process)

    def _forget(self, process: subprocess.Popen[bytes]) -> None:
        self._url, self._token, self._listens = "", "", False
        for end in (process.stdin, process.stdout):
            if end is not None:
                with contextlib.suppress(OSError):
                    end.close()


def _hand_over(process: subprocess.Popen[bytes], brief: ViewerBrief) -> None:
    """Write the brief; the pipe stays open, as the viewer's lifeline, until `Viewer.close`."""
    if process.stdin is not None:
        with contextlib.suppress(OSError, ValueError):
            process.stdin.write(pack_brief(brief))
            process.stdin.flush()


def _yield_processor(pid: int) -> None:
    """Let everything else run before a process that leads a session of its own.

    Where the kernel groups processes by session (autogroups), nice counts within a session, and
    that of the group between them.
    """
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, pid, NICE)
        Path(f"/proc/{pid}/autogroup").write_text(str(NICE), "ascii")


def _let_go(process: subprocess.Popen[bytes]) -> None:
    """Close the lifeline."""
    if process.stdin is not None:
        with contextlib.suppress(OSError):
            process.stdin.close()


def _how(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
