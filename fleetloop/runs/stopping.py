"""`fleetloop stop`: ends a run as Ctrl-C in its terminal does, and says how it ended."""

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bridge.process.waiting import readable
from configs.errors import ExitStatus, InfrastructureError
from fleetloop.door.client import About, RunClient, RunEndedError, open_run
from fleetloop.results.run_folder import SUMMARY
from fleetloop.signals import interruptible
from fleetloop.terminal import say, say_json


@interruptible
def stop_run(name: str, *, within_s: float, force: bool, as_json: bool) -> int:
    """End a run, wait for the end of its launcher, print the verdict; return the exit status.

    Args:
        name: of the run, or its folder; "": the only one.
        within_s: longest wait for its end, page and figures included.
        force: also if others hold its controls.
        as_json: print one JSON document.

    Raises:
        ScenarioError: there is no such run, or others hold its controls.
        InfrastructureError: it doesn't end in time.
    """
    try:
        about = _stopped(name, within_s, force=force)
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    summary = _summary(Path(about.folder)) if about.folder else {}
    told = {
        "run": about.run,
        "folder": about.folder or None,
        "verdict": summary.get("verdict"),
        "reason": summary.get("reason"),
        "ended_at_s": summary.get("simulated_s"),
    }
    if as_json:
        say_json(told)
        return ExitStatus.OK
    at = "" if told["ended_at_s"] is None else f" at t = {told['ended_at_s']:.3f} s"
    say(f"{about.run}: ended{at}")
    if summary:
        reason = f": {told['reason']}" if told["reason"] else ""
        say(f"verdict  {told['verdict']}{reason}")
        say(f"run      {told['folder']}")
    else:
        say("verdict  none: it left no summary")
    return ExitStatus.OK


def _stopped(name: str, within_s: float, *, force: bool) -> About:
    with open_run(name) as client:
        about, pid = client.about(), client.pid
        with _watched(pid, about.run) as ended:
            _ask(client, force=force)
            if not readable([ended], within_s):
                raise InfrastructureError(
                    f"{about.run}: has not ended within {within_s:g} s; its launcher is {pid}"
                )
    return about


@contextlib.contextmanager
def _watched(pid: int, run: str) -> Iterator[int]:
    """A descriptor that is readable once a process has ended.

    Raises:
        InfrastructureError: it isn't this system's.
    """
    if pid <= 0:
        raise InfrastructureError(f"{run}: its launcher runs in another container; stop it there")
    try:
        descriptor = os.pidfd_open(pid)
    except OSError as error:
        raise InfrastructureError(f"{run}: its launcher {pid}: {error.strerror}") from error
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _ask(client: RunClient, *, force: bool) -> None:
    with contextlib.suppress(RunEndedError):  # just now
        client.take_controls("fleetloop stop", force=force)
        client.ask("run.stop")


def _summary(folder: Path) -> dict[str, Any]:
    try:
        found = json.loads((folder / SUMMARY).read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
