"""A role on another machine follows the launcher of its run over the network.

The launcher's last word says why the run was ended before its time. Its token goes with it, or with
the way to it.
"""

from functools import partial

from bridge.network import keys
from bridge.network.reports import LauncherReport
from bridge.network.zenoh_link import ZenohLink
from bridge.process.lifecycle import LAUNCHER_GONE, Stop
from configs.roles import LAUNCHER

RUN_ENDED = "the run was ended"


def follow_launcher(link: ZenohLink, run: str, stop: Stop) -> None:
    """End with the run, for its reason."""

    def on_report(payload: bytes) -> None:
        report = LauncherReport.decode(payload)
        if report is not None:
            stop.end(f"{RUN_ENDED}: {report.reason}")

    link.each(keys.report(run, LAUNCHER.name), on_report)
    link.on_gone(keys.live(run, LAUNCHER.name), partial(stop.end, LAUNCHER_GONE))
