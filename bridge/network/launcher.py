"""A role on another machine follows the launcher of its run over the network.

    there     the launcher's token is there
    away      it is gone, or the way to it: a controller stops its robot; the session tries to come
              back by itself, and with it the token
    over      away for longer than `rejoin_s`, or the launcher's last word came: the role ends

The launcher's last word says why the run was ended before its time. Its token goes with it.
"""

import threading

from bridge.network import keys
from bridge.network.reports import LauncherReport
from bridge.network.zenoh_link import ZenohLink
from bridge.process.lifecycle import LAUNCHER_GONE, Stop
from configs.connections import NetworkLink
from configs.roles import LAUNCHER

RUN_ENDED = "the run was ended"
CUT_OFF = "cut off from the launcher"


class LauncherWatch:
    """Follows one launcher, on the network's threads."""

    def __init__(self, link: ZenohLink, network: NetworkLink, stop: Stop) -> None:
        self.away = False
        """Whether the launcher is away; read by loops."""
        self._rejoin_s = network.rejoin_s
        self._stop = stop
        self._lock = threading.Lock()
        self._limit: threading.Timer | None = None
        link.each(keys.report(network.run, LAUNCHER.name), self._hear)
        link.each_live(keys.live(network.run, LAUNCHER.name), self._note)

    def _hear(self, payload: bytes) -> None:
        report = LauncherReport.decode(payload)
        if report is not None:
            self._stop.end(f"{RUN_ENDED}: {report.reason}")

    def _note(self, _: str, there: bool) -> None:
        with self._lock:
            self.away = not there
            if self._limit is not None:
                self._limit.cancel()
                self._limit = None
            if there:
                return
            if not self._rejoin_s:
                self._stop.end(LAUNCHER_GONE)
                return
            self._limit = threading.Timer(self._rejoin_s, self._stop.end, [LAUNCHER_GONE])
            self._limit.daemon = True
            self._limit.start()
