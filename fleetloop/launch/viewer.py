"""The viewer of one run: a process that the launcher starts when it is asked for it.

    request          arguments                answer
    live.open        [view]                   url: of the page, once it listens; the same at the
                                              next time; view "foxglove": the Foxglove WebSocket's
    live.listening   token, view, url         -: the viewer itself says where it serves a view
    live.refused     token, view, why         -: or why it can't
    live.wanted      token                    -: to the viewer, once a Foxglove WebSocket is wanted

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
from bridge.process.scheduling import go_batch
from configs.brief import ViewerBrief
from configs.errors import InfrastructureError, ScenarioError
from configs.roles import VIEWER
from fleetloop import packages
from fleetloop.door.requests import Request, Respond

PAGE, FOXGLOVE = "page", "foxglove"
"""Views of a run: the page is there from the viewer's start, the other one once it is wanted."""
NO_VIEWER = (
    "a router of its own knows no viewer, so that this run can have no page; one with"
    ' network.router = "launcher" can'
)
NICE = 10
"""Of all its threads, which start after it is set: a tenth of the processor of what it competes
with, which is about what a page needs. They are batch work, too, as the
recorder of a lockstep run: when one wakes up, it takes the processor from none."""
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
        self._token = ""
        self._urls: dict[str, str] = {}  # by view, of those that are served
        self._asking: dict[str, list[Respond]] = {PAGE: [], FOXGLOVE: []}
        self._awaits_wish: Respond | None = None  # the viewer itself
        self._deadline_s = 0.0
        said = {"token": str, "view": str}
        self.requests: Mapping[str, Request] = {
            "live.open": Request({}, self._open, optional={"view": str}),
            "live.listening": Request({**said, "url": str}, self._listening),
            "live.refused": Request({**said, "why": str}, self._refused),
            "live.wanted": Request({"token": str}, self._wanted),
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
        elif any(self._asking.values()) and self._now_s() > self._deadline_s:
            self._answer_all({"error": f"the viewer: no page within {self._start_deadline_s:g} s"})
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

    def _open(self, respond: Respond, view: str = PAGE) -> None:
        if view not in self._asking:
            known = ", ".join(self._asking)
            raise ScenarioError(f"live.open: view {view[:40]!r}: must be one of {known}")
        if self._process is None:
            self._start()
        if view in self._urls:
            respond({"url": self._urls[view]})
            return
        if not any(self._asking.values()):
            self._deadline_s = self._now_s() + self._start_deadline_s
        self._asking[view].append(respond)
        self._pass_wish_on()

    def _listening(self, respond: Respond, token: str, view: str, url: str) -> None:
        self._check("live.listening", token, view)
        self._urls[view] = url
        respond({})
        self._answer(view, {"url": url})

    def _refused(self, respond: Respond, token: str, view: str, why: str) -> None:
        self._check("live.refused", token, view)
        respond({})
        self._answer(view, {"error": f"live.open: {why}"})

    def _wanted(self, respond: Respond, token: str) -> None:
        self._check("live.wanted", token, FOXGLOVE)
        self._awaits_wish = respond
        self._pass_wish_on()

    def _pass_wish_on(self) -> None:
        """Tell the viewer that a Foxglove WebSocket is wanted, if it listens to that."""
        tell = self._awaits_wish
        if self._asking[FOXGLOVE] and tell is not None:
            self._awaits_wish = None
            tell({})

    def _check(self, request: str, token: str, view: str) -> None:
        """Refuse all but the viewer itself."""
        theirs, ours = token.encode(), self._token.encode()
        if self._process is None or not secrets.compare_digest(theirs, ours):
            raise ScenarioError(f"{request}: not this run's viewer")
        if view not in self._asking:
            raise ScenarioError(f"{request}: no view {view[:40]!r}")

    # --- process ---------------------------------------------------------------------------------

    def _start(self) -> None:
        token = secrets.token_urlsafe(24)
        brief = self._brief(token)
        if brief is None:
            raise ScenarioError(f"live.open: {NO_VIEWER}")
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
        # It reads once it has imported its libraries; the launcher doesn't wait for that.
        threading.Thread(target=_hand_over, args=(process, brief), daemon=True).start()

    def _tell(self, answer: Mapping[str, str]) -> None:
        if "error" in answer:
            self._note(answer["error"])
        elif answer["url"]:
            self._note(answer["url"])

    def _answer(self, view: str, answer: dict[str, str]) -> None:
        asking, self._asking[view] = self._asking[view], []
        for respond in asking:
            respond({**answer})

    def _answer_all(self, answer: dict[str, str]) -> None:
        for view in self._asking:
            self._answer(view, answer)

    def _ended(self, process: subprocess.Popen[bytes]) -> None:
        """Say that it has ended, and why."""
        self._process = None
        lines = process.stdout.read().splitlines() if process.stdout is not None else []
        said = [status for line in lines if (status := Status.from_line(line)) is not None]
        code = process.returncode
        why = said[-1].error if said else _how(code)
        text = f"the viewer has ended: {why}; the run goes on without it"
        if any(self._asking.values()):
            self._answer_all({"error": text})
        else:
            self._note(text)
        self._forget(process)

    def _forget(self, process: subprocess.Popen[bytes]) -> None:
        self._token, self._awaits_wish = "", None
        self._urls.clear()
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
        go_batch(pid)
        Path(f"/proc/{pid}/autogroup").write_text(str(NICE), "ascii")


def _let_go(process: subprocess.Popen[bytes]) -> None:
    """Close the lifeline."""
    if process.stdin is not None:
        with contextlib.suppress(OSError):
            process.stdin.close()


def _how(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
