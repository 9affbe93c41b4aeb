"""Reads what the processes of a run send to the launcher; what can't be is counted and named.

A process may say whatever it likes on its own keys, and another client with its credentials too.
"""

from collections.abc import Iterable

from bridge.network import keys
from bridge.network.link import Dropped
from bridge.network.messages import Notice, Progress
from bridge.network.refused_messages import Refusals
from bridge.network.reports import Report, decode_report
from configs.brief import Schedule
from configs.events import Event
from configs.roles import AGENT


def of_process(process: str, event: Event) -> Event:
    """An event as this process may announce it: a controller speaks of its own robot only."""
    role, _, robot = process.partition("/")
    return event._replace(source=robot) if role == AGENT.name else event


class MessageReader:
    """Reads the messages of one run."""

    def __init__(self, schedule: Schedule) -> None:
        self.refusals = Refusals()
        self._schedule = schedule

    def progress(self, process: str, payload: bytes) -> Progress | None:
        """Progress of a process; None if it is impossible."""
        progress = Progress.decode(payload)
        wrong = "not well formed" if progress is None else self._wrong(progress)
        if wrong is None:
            return progress
        self.refusals.note("progress message", process, wrong.partition(" ")[0], wrong)
        return None

    def report(self, process: str, payload: bytes) -> Report | None:
        """A process's last word, None if it is none."""
        report = decode_report(process, payload)
        if report is None:
            self.refusals.note("report", process, "not well formed")
        return report

    def event(self, process: str, payload: bytes) -> Event | None:
        """An event that a process has just announced, None if there is none; see `of_process`."""
        notice = Notice.decode(payload)
        if notice is None:
            self.refusals.note("notice", process, "not well formed")
            return None
        return of_process(process, notice.event)

    def note_dropped(self, dropped: Iterable[Dropped]) -> None:
        """Count what found no room."""
        for tag, key, count in dropped:
            why = "more than can be read"
            self.refusals.note(f"{tag} message", keys.process_of(key), "flood", why, count)

    def _wrong(self, progress: Progress) -> str | None:
        schedule, (tick, t_ns, wall_ns, _) = self._schedule, progress
        if not -schedule.countdown_ticks <= tick <= schedule.ticks:
            return f"tick {tick}, where the run has {schedule.ticks}"
        if t_ns not in (0, tick * schedule.period_ns) or wall_ns < 0:
            return f"time {t_ns * 1e-9:.6g} s after {wall_ns * 1e-9:.6g} s at tick {tick}"
        return None
