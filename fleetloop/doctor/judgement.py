"""Judgements of what was found on this machine: value, level and remedy. Pure.

error      a run can't work here, or not at the rate that was asked for
warning    it may not work, or worse than it could
ok         nothing to change
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from fleetloop.check.finding import Finding, Level
from fleetloop.launch.open_files import BESIDES, PER_ROLE

RATES_HZ = (1000, 500, 200, 100, 50)
"""Control rates of shipped scenarios, and one below."""
GOOD_SHARE = 0.25
"""Of a period: later wake-ups than this take time from the tick."""
PLENTY_OF_ROBOTS = 256
FEWEST_ROBOTS = 4
_SLOW_CLOCKS = frozenset({"hpet", "acpi_pm", "jiffies", "pit", "refined-jiffies"})
_STAMP_BYTES = len("/20261127-084500--123456/.can")
"""Of the path of a socket, around the base, the scenario's name and the bus's."""
_TIGHT_BYTES, _COMFORTABLE_BYTES = 16, 40
_LEAST_FREE_BYTES, _GOOD_FREE_BYTES = 100 << 20, 2 << 30
_OLDEST_KERNEL = (5, 4)


@dataclass(frozen=True, slots=True)
class WakeUps:
    """Lateness of wake-ups at absolute times [s], sorted, and the period at which they were."""

    late_s: Sequence[float]
    period_s: float

    def quantile_s(self, share: float) -> float:
        """The lateness that this share of them doesn't exceed."""
        return self.late_s[max(ceil(share * len(self.late_s)) - 1, 0)]

    def missed(self, period_s: float) -> int:
        """Wake-ups that were later than a whole period."""
        return sum(late_s > period_s for late_s in self.late_s)


def wake_ups(measured: WakeUps, *, realtime: bool, rate_hz: float | None) -> Finding:
    """Whether ticks can begin on time: p99 within a quarter of the period, none skipped."""
    p50, p99 = measured.quantile_s(0.5), measured.quantile_s(0.99)
    held = next((rate for rate in RATES_HZ if _holds(measured, rate)), None)
    with_what = "SCHED_FIFO" if realtime else "no priority"
    value = f"late by {_time(p50)} (p50), {_time(p99)} (p99), {_time(measured.late_s[-1])} at most"
    value += f", with {with_what}; "
    value += f"in real time good for {held} Hz" if held else "in real time for less than 50 Hz"
    remedy = "let nothing else run, leave power saving, use a kernel with PREEMPT_RT"
    if not realtime:
        remedy = f"give SCHED_FIFO (below); {remedy}"
    remedy += "; lockstep doesn't mind"
    level: Level = "ok" if held else "warning"
    limit = ""
    if rate_hz is not None:
        limit = f"p99 <= {_time(GOOD_SHARE / rate_hz)}, none above {_time(1.0 / rate_hz)}"
        if _holds(measured, rate_hz):
            level = "ok"
        else:
            level = "error" if p99 > 1.0 / rate_hz else "warning"
    said = remedy if level != "ok" else ""
    return Finding(level, "wake-ups", value, limit=limit, remedy=said)


def _holds(measured: WakeUps, rate_hz: float) -> bool:
    period_s = 1.0 / rate_hz
    return measured.quantile_s(0.99) <= GOOD_SHARE * period_s and not measured.missed(period_s)


def priority(allowed: bool, limit: int, *, processors: int) -> Finding:
    """SCHED_FIFO; `limit`: RLIMIT_RTPRIO, negative if there is none."""
    if processors == 1:
        return Finding("ok", "SCHED_FIFO", "not used on a single processor")
    if allowed:
        return Finding("ok", "SCHED_FIFO", "allowed")
    remedy = (
        "for real time: ulimit -r 50, or as root a line"
        " '@YOUR_GROUP - rtprio 50' in /etc/security/limits.d/fleetloop.conf and a new login; in a"
        " container --cap-add SYS_NICE --ulimit rtprio=50"
    )
    value = f"not allowed; rtprio {'unlimited' if limit < 0 else limit}"
    return Finding("warning", "SCHED_FIFO", value, remedy=remedy)


def memory_locking(limit_bytes: int, *, root: bool) -> Finding:
    """RLIMIT_MEMLOCK, negative if there is none: a page that has to be read costs milliseconds."""
    if root or limit_bytes < 0:
        return Finding("ok", "memory locking", "allowed")
    value = f"at most {limit_bytes / (1 << 20):.0f} MiB"
    if limit_bytes >= 1 << 30:
        return Finding("ok", "memory locking", value)
    remedy = "for real time: ulimit -l unlimited, or 'memlock unlimited' beside rtprio"
    return Finding("warning", "memory locking", value, remedy=remedy)


def processors(count: int, load: float) -> Finding:
    """Processors for this process, and how many are busy (load average of a minute)."""
    value = f"{count}, load {load:.1f} in the last minute"
    if count < 2:
        remedy = "real time wants 2 or more; lockstep is slower on one"
        return Finding("warning", "processors", value, remedy=remedy)
    if load > 0.75 * count:
        return Finding("warning", "processors", value, remedy="other programs slow every run down")
    return Finding("ok", "processors", value)


def governor(name: str | None) -> Finding | None:
    """The frequency governor of the processors; None: the kernel says nothing of it."""
    if name is None:
        return None
    if name != "powersave":
        return Finding("ok", "frequency governor", name)
    remedy = "for real time: cpupower frequency-set -g performance"
    return Finding("warning", "frequency governor", name, remedy=remedy)


def clock_source(name: str | None) -> Finding:
    """The kernel's clock source: a slow one is read by a system call, several times a tick."""
    if name is None:
        return Finding("ok", "clock source", "not known")
    if name in _SLOW_CLOCKS:
        remedy = "boot with clocksource=tsc if the machine has it; every reading costs microseconds"
        return Finding("warning", "clock source", name, remedy=remedy)
    return Finding("ok", "clock source", name)


def kernel(release: str, *, preempt_rt: bool) -> Finding:
    """The kernel's version."""
    value = f"Linux {release}{' with PREEMPT_RT' if preempt_rt else ''}"
    numbers = [int(part) for part in release.split(".")[:2] if part.isdigit()]
    if tuple(numbers) < _OLDEST_KERNEL:
        needs = ".".join(map(str, _OLDEST_KERNEL))
        return Finding("error", "kernel", value, limit=f">= {needs}", remedy="a newer kernel")
    return Finding("ok", "kernel", value)


def loopback(problem: str) -> Finding:
    """Whether a router can listen on the loopback interface; "" if it can."""
    if problem:
        remedy = "bring it up: ip link set lo up; in a sandbox allow sockets"
        return Finding("error", "loopback", problem, remedy=remedy)
    return Finding("ok", "loopback", "TCP ports of 127.0.0.1 can be listened on")


def sockets_folder(folder: str, problem: str) -> Finding:
    """Whether buses can be made in the folder for sockets; "" if they can."""
    if problem:
        remedy = "set FLEETLOOP_RUNTIME to a short folder of your own, such as /tmp/fl"
        return Finding("error", "folder for sockets", problem, remedy=remedy)
    return Finding("ok", "folder for sockets", f"{folder}: buses can be made there")


def socket_path(base_bytes: int, most_bytes: int) -> Finding:
    """Room in the path of a socket for the names of the run's folder and of a bus."""
    left = most_bytes - base_bytes - _STAMP_BYTES
    value = f"{left} bytes are left for the names of the run's folder and a robot"
    level: Level = "ok"
    if left < _COMFORTABLE_BYTES:
        level = "error" if left < _TIGHT_BYTES else "warning"
    remedy = "set FLEETLOOP_RUNTIME to a shorter folder, such as /tmp/fl" if level != "ok" else ""
    return Finding(level, "path of sockets", value, remedy=remedy)


def open_files(hard: int) -> Finding:
    """RLIMIT_NOFILE, negative if there is none: the launcher has several files per process."""
    if hard < 0:
        return Finding("ok", "open files", "no limit")
    robots = (hard - BESIDES) // PER_ROLE - 2  # plant and recorder
    value = f"limit {hard}: enough for {max(robots, 0)} robots"
    remedy = f"ulimit -Hn {PER_ROLE * (PLENTY_OF_ROBOTS + 2) + BESIDES} as root"
    if robots < FEWEST_ROBOTS:
        return Finding("error", "open files", value, remedy=remedy)
    if robots < PLENTY_OF_ROBOTS:
        return Finding("warning", "open files", value, remedy=f"for more robots {remedy}")
    return Finding("ok", "open files", value)


def can_interfaces(names: Sequence[str], modules: Sequence[str], *, registered: bool) -> Finding:
    """SocketCAN interfaces, the kernel's CAN modules, and ours in python-can."""
    if not registered:
        value = "python-can doesn't know the interface fleetloop"
        remedy = "install Fleetloop again in this environment: its entry points are missing"
        return Finding("error", "CAN", value, remedy=remedy)
    found = f"SocketCAN: {', '.join(names)}" if names else "no SocketCAN interface"
    loaded = f"modules {', '.join(modules)}" if modules else "no CAN modules"
    remedy = ""
    if not names:
        remedy = (
            "for real drives only: ip link set can0 up type can bitrate 1000000; to try it:"
            " modprobe vcan && ip link add vcan0 type vcan && ip link set vcan0 up"
        )
    return Finding("ok", "CAN", f"emulated buses need none; {found}, {loaded}", remedy=remedy)


def scouting() -> Finding:
    """Multicast."""
    value = "not used: processes are told where their router is"
    return Finding("ok", "multicast scouting", value)


def versions(installed: Sequence[tuple[str, str]], how: str) -> Finding:
    """Versions, and how what runs every tick runs: compiled, or pure Python and why."""
    said = ", ".join(f"{name} {version}" for name, version in installed)
    return Finding("ok", "versions", f"{said}; {how}")


def packages(problem: str) -> Finding:
    """Whether the modules that processes would load are ours; "" if they are."""
    if problem:
        return Finding("error", "packages", problem)
    return Finding("ok", "packages", "agents, plant and fleetloop are Fleetloop's own")


def leftovers(folders: Sequence[str], processes: Sequence[tuple[int, str]]) -> Finding:
    """Sockets of runs that were killed, and role processes that no launcher holds."""
    said, remedies = [], []
    if folders:
        said.append(f"sockets of {_listed(folders)}")
        remedies.append("the next run removes the sockets")
    if processes:
        said.append("on their own: " + _listed([f"{name} ({pid})" for pid, name in processes]))
        pids = " ".join(str(pid) for pid, _ in processes)
        remedies.append(f"unless you started them so (fleetloop agent, plant): kill {pids}")
    if not said:
        return Finding("ok", "leftovers", "none of former runs")
    level: Level = "warning" if processes else "ok"
    return Finding(level, "leftovers", "; ".join(said), remedy="; ".join(remedies))


def disk(folder: str, free_bytes: int | None) -> Finding:
    """Space where runs go; None: this user can't write there."""
    if free_bytes is None:
        remedy = "run elsewhere, or name a folder: --out"
        return Finding("error", "disk", f"{folder} can't be written", remedy=remedy)
    value = f"{free_bytes / (1 << 30):.1f} GiB free in {folder}"
    if free_bytes >= _GOOD_FREE_BYTES:
        return Finding("ok", "disk", value)
    remedy = "remove old runs, or name a folder elsewhere: --out; a record is a few MiB a second"
    level: Level = "warning" if free_bytes >= _LEAST_FREE_BYTES else "error"
    return Finding(level, "disk", value, remedy=remedy)


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


def _time(seconds: float) -> str:
    return f"{seconds * 1e6:.0f} µs" if seconds < 1e-3 else f"{seconds * 1e3:.2g} ms"
