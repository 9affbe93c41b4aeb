"""The roles of a run on other machines, as the launcher sees them over the network.

waiting    no token yet                     counts against the start deadline
there      token seen                       ends with its report, or is cut off with its token
ended      its report came                  with a failure in it: the run has failed
cut off    token gone                       there again if it comes back
lost       cut off for `rejoin_s`, at least for `GRACE_S`, and no report
"""

from collections.abc import Iterable

from bridge.network.reports import Report
from fleetloop.launch.child import CRASHED, GAVE_UP, Failure

GRACE_S = 0.5
"""A report may come a little later than the end of the token."""


class RemoteRoles:
    """State of the roles on other machines."""

    def __init__(self, processes: Iterable[str], rejoin_s: float = 0.0) -> None:
        self.processes = frozenset(processes)
        self._reports: dict[str, Report] = {}
        self._there: set[str] = set()
        self._gone_s: dict[str, float] = {}
        self._rejoin_s = rejoin_s
        self._named: set[str] = set()  # those that are said to be cut off

    def note_token(self, process: str, now_s: float, *, there: bool) -> float | None:
        """A liveliness token came or went; return how long one was cut off that is back."""
        if process not in self.processes:
            return None
        if there:
            self._there.add(process)
            gone_s = self._gone_s.pop(process, now_s)
            if process in self._named:
                self._named.remove(process)
                return now_s - gone_s
        elif process in self._there:
            self._gone_s.setdefault(process, now_s)
        return None

    def newly_cut_off(self, now_s: float) -> list[str]:
        """Those that are cut off and may come back, each once."""
        if not self._rejoin_s:
            return []
        found = [
            process
            for process, gone_s in self._gone_s.items()
            if process not in self._reports | dict.fromkeys(self._named)
            and now_s - gone_s > GRACE_S
        ]
        self._named.update(found)
        return found

    def note_report(self, process: str, report: Report) -> None:
        """A process said its last word."""
        if process in self.processes:
            self._reports[process] = report

    def absent(self) -> list[str]:
        """Those that have not come yet."""
        return sorted(self.processes - self._there)

    def ended(self, now_s: float) -> bool:
        """Whether all of them have said their last word or are lost."""
        lost = {it for it, gone_s in self._gone_s.items() if now_s - gone_s >= self._rejoin_s}
        return self.processes <= self._reports.keys() | lost

    def failure(self, now_s: float) -> Failure | None:
        """Why one of them ended before its time, None if none did."""
        for process, report in self._reports.items():
            if report.failure:
                return Failure(GAVE_UP, process, report.failure)
        for process, gone_s in self._gone_s.items():
            if process not in self._reports and now_s - gone_s > max(GRACE_S, self._rejoin_s):
                text = f"{process}: lost; it, its machine or the network to it is gone"
                return Failure(CRASHED, process, text)
        return None
