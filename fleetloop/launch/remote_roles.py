"""The roles of a run on other machines, as the launcher sees them over the network.

waiting    no token yet                     counts against the start deadline
there      token seen                       ends with its report, or is lost with its token
ended      its report came                  with a failure in it: the run has failed
lost       token gone, and no report after `GRACE_S`
"""

from collections.abc import Iterable

from bridge.network.reports import Report
from fleetloop.launch.child import CRASHED, GAVE_UP, Failure

GRACE_S = 0.5
"""A report may come a little later than the end of the token."""


class RemoteRoles:
    """State of the roles on other machines."""

    def __init__(self, processes: Iterable[str]) -> None:
        self.processes = frozenset(processes)
        self._reports: dict[str, Report] = {}
        self._there: set[str] = set()
        self._gone_s: dict[str, float] = {}

    def note_token(self, process: str, now_s: float, *, there: bool) -> None:
        """A liveliness token came or went."""
        if process not in self.processes:
            return
        if there:
            self._there.add(process)
            self._gone_s.pop(process, None)
        elif process in self._there:
            self._gone_s.setdefault(process, now_s)

    def note_report(self, process: str, report: Report) -> None:
        """A process said its last word."""
        if process in self.processes:
            self._reports[process] = report

    def absent(self) -> list[str]:
        """Those that have not come yet."""
        return sorted(self.processes - self._there)

    def ended(self) -> bool:
        """Whether all of them have said their last word or are lost."""
        return self.processes <= self._reports.keys() | self._gone_s.keys()

    def failure(self, now_s: float) -> Failure | None:
        """Why one of them ended before its time, None if none did."""
        for process, report in self._reports.items():
            if report.failure:
                return Failure(GAVE_UP, process, report.failure)
        for process, gone_s in self._gone_s.items():
            if process not in self._reports and now_s - gone_s > GRACE_S:
                text = f"{process}: lost; it, its machine or the network to it is gone"
                return Failure(CRASHED, process, text)
        return None
