"""How a role without a launcher beside it follows the one of its run: over the network.

The launcher's last word says why the run was ended before its time. Its token goes with it, or with
the way to it.
"""

from functools import partial

from bridge.network import keys
from bridge.network.access import LAUNCHER
from bridge.network.messages import Report
from bridge.network.zenoh_link import ZenohLink
from bridge.process import LAUNCHER_GONE, Stop

RUN_ENDED = "the run was ended"


def follow_launcher(link: ZenohLink, run: str, stop: Stop) -> None:
    """End with the run, for its reason."""

    def hear(payload: bytes) -> None:
        report = Report.decode(payload)
        if report is not None:
            stop.end(f"{RUN_ENDED}: {report.values.get('reason', '')}")

    link.each(keys.report(run, LAUNCHER), hear)
    link.on_gone(keys.live(run, LAUNCHER), partial(stop.end, LAUNCHER_GONE))
