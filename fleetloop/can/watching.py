"""`fleetloop can list --watch`: the buses that are up, again and again, in place on a terminal."""

import json
import sys
from dataclasses import asdict

from rich.live import Live
from rich.text import Text

from bridge.can_bus import sockets
from bridge.process.clock import SYSTEM_CLOCK
from configs.drives import DEFAULT
from configs.errors import ExitStatus
from fleetloop.can.decoder import protocol_of
from fleetloop.can.listing import BusReport, survey, table
from fleetloop.signals import interruptible
from fleetloop.streams import forget_output
from fleetloop.terminal import ResultConsole


@interruptible
def watch_buses(
    *,
    seconds: float,
    bit_rate: int,
    as_json: bool,
    protocol_name: str = DEFAULT,
    lasting_s: float | None = None,
) -> int:
    """Listen to all buses for `seconds` and show what there is, again and again.

    Elsewhere than on a terminal one listing follows the other; with `as_json` each is a line.

    Args:
        seconds: of a listing.
        bit_rate: that the load refers to [bit/s].
        as_json: an array per line.
        protocol_name: of the drives.
        lasting_s: ends after this time; None: with Ctrl-C, or when the reader is gone.

    Raises:
        ScenarioError: there is no such protocol.
    """
    drives = protocol_of(protocol_name)
    console = ResultConsole()
    in_place = console.is_terminal and not (console.is_dumb_terminal or as_json)
    ends_s = None if lasting_s is None else SYSTEM_CLOCK.monotonic_s() + lasting_s
    try:
        with Live(
            console=console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
        ) as live:
            while True:
                began_s = SYSTEM_CLOCK.monotonic_s()
                left_s = seconds if ends_s is None else min(seconds, max(ends_s - began_s, 0.01))
                reports = survey(left_s, bit_rate, drives)
                if in_place:
                    live.update(Text(_shown(reports, bit_rate)), refresh=True)
                else:
                    _write(_line(reports) if as_json else _shown(reports, bit_rate) + "\n")
                now_s = SYSTEM_CLOCK.monotonic_s()
                if ends_s is not None and now_s >= ends_s:
                    return ExitStatus.OK
                # Without any bus nothing is waited for.
                SYSTEM_CLOCK.sleep(max(began_s + left_s - now_s, 0.0))
    except BrokenPipeError:
        forget_output()
        return ExitStatus.OK
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED


def _shown(reports: list[BusReport], bit_rate: int) -> str:
    if not reports:
        return f"no bus is up in {sockets.base_folder()}"
    problems = [f"{it.run}/{it.bus}: {it.problem}" for it in reports if it.problem]
    return "\n".join([table(reports, bit_rate), *problems])


def _line(reports: list[BusReport]) -> str:
    return json.dumps([asdict(report) for report in reports])


def _write(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
