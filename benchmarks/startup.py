"""From the command to the first tick, and from the last tick to the end, by number of robots.

Start-up is counted in the launcher once its own modules are imported; the whole command comes
besides. Medians, ranges, and ratios of the whole command to one robot within the same round.

The second table has what `fleetloop plant` costs until it is ready and gone again, as a test of CAN
host code pays it once per plant: wall time, and processor time of the plant's process over that of
a Python process that imports python-can and ends, within the same round.

Not measured: a cold disk cache, machines other than this one, other simulators' start-up.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial

from common import arguments, fleet, interleaved, machine, median_and_range, ratios, run, table

from fleetloop.testing import EmulatedPlant

SCENARIO_S = 0.5


def times(scenario: str) -> dict[str, float]:
    """Start-up, teardown and the whole command [s]."""
    began = time.perf_counter()
    summary = run(scenario)
    whole = time.perf_counter() - began
    return {"start-up": summary["startup_s"], "teardown": summary["teardown_s"], "whole": whole}


def child_times(child: Callable[[], object]) -> dict[str, float]:
    """Wall and processor time of a call, the latter of the processes that ended in it [s]."""
    began, before = time.perf_counter(), os.times()
    child()
    wall, after = time.perf_counter() - began, os.times()
    processor = sum(after[2:4]) - sum(before[2:4])  # of children
    return {"wall": wall, "processor": processor}


def plant() -> None:
    """An emulated plant, ready and gone."""
    EmulatedPlant("two_robots").stop()


def python_can() -> None:
    """The least that a program on a CAN bus costs."""
    subprocess.run([sys.executable, "-c", "import can"], check=True, timeout=60)


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    rounds = 1 if options.quick else 5
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        cases = {f"{n}": partial(times, fleet(folder, n, SCENARIO_S)) for n in (1, 4, 16)}
        results = interleaved(rounds, cases)
    rows = []
    for n, values in results.items():
        parts = {part: [value[part] for value in values] for part in values[0]}
        whole_of_one = [value["whole"] for value in results["1"]]
        factor = median_and_range(ratios(parts["whole"], whole_of_one), ".2f")
        rows.append((n, *(median_and_range(part, ".2f") for part in parts.values()), factor))
    whole = f"whole command s ({SCENARIO_S:g} s of scenario)"
    table(("robots", "start-up s", "teardown s", whole, "× one robot's"), rows)
    print()
    children = {"import can": python_can, "fleetloop plant": plant}
    plants = interleaved(rounds, {name: partial(child_times, c) for name, c in children.items()})
    rows = []
    for name, values in plants.items():
        wall, processor = ([value[part] for value in values] for part in ("wall", "processor"))
        least = [value["processor"] for value in plants["import can"]]
        factor = median_and_range(ratios(processor, least), ".1f")
        rows.append((name, *(median_and_range(v, ".2f") for v in (wall, processor)), factor))
    table(("process", "wall s", "processor s", "× import can's"), rows)


if __name__ == "__main__":
    main()
