"""`fleetloop doctor`: what goes wrong in practice, a line each with its remedy."""

import os
import platform
import resource
from collections.abc import Iterator
from dataclasses import asdict

from rich.text import Text

from bridge.can_bus import sockets
from configs import compiled
from configs.errors import ExitStatus
from fleetloop.check.finding import Finding, worst
from fleetloop.doctor import judgement, probes
from fleetloop.signals import interruptible
from fleetloop.terminal import ResultConsole, say, say_json

_VERDICTS = {
    "ok": "nothing to change",
    "warning": "runs work here; mind the warnings",
    "error": "something that is needed is missing",
}
_STYLES = {"ok": "green", "warning": "yellow", "error": "red"}
_INDENT = 9


@interruptible
def doctor(*, rate_hz: float | None, seconds: float, as_json: bool) -> int:
    """Examine this machine; exit status 1 if something is missing that a run needs.

    Args:
        rate_hz: the control rate in real time that it has to hold; None: just say which.
        seconds: time for the measurement of wake-ups.
        as_json: print one JSON document.
    """
    console = ResultConsole()
    found = []
    try:
        for finding in findings(rate_hz, seconds):
            found.append(finding)
            if not as_json:
                _print(console, finding)
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    level = worst(found)
    if as_json:
        listed = [{key: value for key, value in asdict(it).items() if key in _KEYS} for it in found]
        say_json({"sound": level != "error", "worst": level, "findings": listed})
    else:
        say(_VERDICTS[level])
    return ExitStatus.FAILED if level == "error" else ExitStatus.OK


_KEYS = ("level", "title", "value", "limit", "remedy")


def findings(rate_hz: float | None, seconds: float) -> Iterator[Finding]:
    """Everything, one after the other as it is found."""
    processors = probes.processors()
    with probes.realtime_priority() as realtime:
        measured = probes.wake_ups(1.0 / (rate_hz or judgement.RATES_HZ[0]), seconds)
    yield judgement.wake_ups(measured, realtime=realtime, rate_hz=rate_hz)
    priority = probes.limit(resource.RLIMIT_RTPRIO)
    yield judgement.priority(realtime, priority, processors=processors)
    lockable = probes.limit(resource.RLIMIT_MEMLOCK)
    yield judgement.memory_locking(lockable, root=os.geteuid() == 0)
    yield judgement.processors(processors, os.getloadavg()[0])
    cpu = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"
    if (governor := judgement.governor(probes.text_of(cpu))) is not None:
        yield governor
    clock = "/sys/devices/system/clocksource/clocksource0/current_clocksource"
    yield judgement.clock_source(probes.text_of(clock))
    preempt_rt = probes.text_of("/sys/kernel/realtime") == "1"
    yield judgement.kernel(platform.release(), preempt_rt=preempt_rt)
    yield judgement.loopback(probes.loopback_problem())
    base = sockets.base_folder()
    yield judgement.sockets_folder(str(base), probes.bus_problem())
    yield judgement.socket_path(len(os.fsencode(base)), sockets.MAX_PATH_BYTES)
    yield judgement.open_files(probes.limit(resource.RLIMIT_NOFILE))
    yield judgement.scouting()
    yield judgement.can_interfaces(
        probes.can_interfaces(), probes.can_modules(), registered=probes.registered()
    )
    yield judgement.versions(probes.versions(), compiled.how())
    yield judgement.packages(probes.package_problem())
    yield judgement.leftovers(probes.dead_runs(), probes.lone_roles())
    place = probes.place_of_runs()
    yield judgement.disk(str(place), probes.free_bytes(place))


def _print(console: ResultConsole, finding: Finding) -> None:
    """A line, and below it what to change."""
    needs = f", needs {finding.limit}" if finding.limit and finding.level != "ok" else ""
    text = Text.assemble(
        (f"{finding.level:<{_INDENT - 1}} ", _STYLES[finding.level]),
        f"{finding.title}: {finding.value}{needs}",
    )
    console.print(text, soft_wrap=True)
    if finding.remedy:
        remedy = Text(f"{'':<{_INDENT}}{finding.remedy}", "dim")
        console.print(remedy, soft_wrap=True)
