"""Tests whose promise is about the wall clock: tried again if it was the machine that broke it.

    @pytest.mark.wall_clock     left out with -m "not wall_clock"
    @pytest.mark.system         its processes have deadlines: once more if the machine stood still

Whether the machine stalled, the runs of the test say themselves, in the summaries that they left:
`machine`, what the launcher saw of it, the notices of controllers, and `waits_s`, how long
processes were kept from a processor. Where no run lived to say so, the load of the machine decides.
A test that fails on a machine that did not stall has failed.
"""

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

TRIES, SYSTEM_TRIES = 4, 2
LATE_S = 0.05
"""A wait of the launcher that ends so much later than asked for isn't a quiet machine's."""
WAITING_SHARE = 0.05
"""So much of a run's time without a processor, although there was something to do, neither."""
PAUSE_S = 2.0
TIMEOUT_S = 300
"""Of all tries together, as `timeout` in pyproject.toml is of others."""

Summary = dict[str, Any]


def stalled(summary: Summary) -> str:
    """How the machine kept a run from its time, "" if it didn't."""
    machine = summary.get("machine") or {}
    if machine.get("stalls"):
        return f"the machine stalled for {machine['longest_stall_s']:.2f} s"
    if machine.get("plant_stalls"):
        return f"the plant stalled {len(machine['plant_stalls'])} times"
    said = [*summary.get("stopped_robots", {}).values(), *summary.get("notices", {}).values()]
    if any("or its machine, stalled" in str(text) for text in said):
        return "a controller stalled"
    if machine.get("longest_late_s", 0.0) > LATE_S:
        return f"the launcher woke up {machine['longest_late_s']:.3f} s late"
    wall_s = max(summary["wall_s"] + summary["startup_s"] + summary["teardown_s"], 1e-3)
    waits = {"launcher": machine.get("processor_wait_s", 0.0)}
    waits |= {name: parts.get("processor", 0.0) for name, parts in summary["waits_s"].items()}
    name, wait_s = max(waits.items(), key=lambda item: item[1])
    if wait_s > WAITING_SHARE * wall_s:
        return f"{name} waited {wait_s:.2f} s of {wall_s:.2f} s for a processor"
    return ""


def why_again(folder: Path | None) -> str:
    """Why a test that left these files may be tried again, "" if it has no excuse."""
    files = folder.rglob("summary.json") if folder is not None else ()
    said = [stalled(json.loads(file.read_text("utf-8"))) for file in files]
    load, cores = os.getloadavg()[0], len(os.sched_getaffinity(0))
    if not said and load > cores:
        said.append(f"load {load:.1f} on {cores} cores")
    return "; ".join(filter(None, said))


def stood_still(folder: Path | None) -> str:
    """How long the machine stood still in runs that left these files, "" if it didn't."""
    files = folder.rglob("summary.json") if folder is not None else ()
    machines = (json.loads(file.read_text("utf-8")).get("machine") or {} for file in files)
    longest_s = max((it["longest_stall_s"] for it in machines if it.get("stalls")), default=0.0)
    return f"the machine stalled for {longest_s:.2f} s" if longest_s else ""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give tests of the wall clock time for all their tries."""
    for item in items:
        if item.get_closest_marker("wall_clock") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(TIMEOUT_S))


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> object:
    """Call a test of the wall clock up to `TRIES` times, one of processes `SYSTEM_TRIES`."""
    if pyfuncitem.get_closest_marker("wall_clock") is not None:
        tries, excuse = TRIES, why_again
    elif pyfuncitem.get_closest_marker("system") is not None:
        tries, excuse = SYSTEM_TRIES, stood_still
    else:
        return None
    names = pyfuncitem._fixtureinfo.argnames
    arguments = {name: pyfuncitem.funcargs[name] for name in names}
    folder: Path | None = pyfuncitem.funcargs.get("tmp_path")
    for left in reversed(range(tries)):
        try:
            pyfuncitem.obj(**arguments)
        except (AssertionError, subprocess.TimeoutExpired, pytest.fail.Exception) as error:
            why = excuse(folder)
            if not left or not why or str(error).startswith("Timeout"):
                raise
            pyfuncitem.user_properties.append(("tried again", why))
            _empty(folder)
            time.sleep(PAUSE_S)  # what kept the machine busy may be over
        else:
            break
    return True


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say which tests were tried again, and why."""
    for test, why in _retried(terminalreporter):
        terminalreporter.write_line(f"TRIED AGAIN {test}: {why}")


def _retried(reporter: Any) -> Iterator[tuple[str, str]]:
    for report in (*reporter.stats.get("passed", ()), *reporter.stats.get("failed", ())):
        if report.when == "call":
            yield from (
                (report.nodeid, why) for name, why in report.user_properties if why and name
            )


def _empty(folder: Path | None) -> None:
    for path in folder.iterdir() if folder is not None else ():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
