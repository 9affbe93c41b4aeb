"""Cost of a lockstep tick by the number of robots, and where it goes.

Processor time by part comes from `fleetloop run --profile`: bus with its system calls, Zenoh with
its threads and the router, record with the recorder's process. The ring has an edge per robot, so a
linear cost is what to expect: a robot-tick's ratio to that of the smallest fleet, within the same
round, stays near 1. Medians and ranges; parts are medians.

Not measured: other graphs, more cores, what profiling itself costs.
"""

import statistics
import tempfile
from functools import partial

from common import (
    arguments,
    fleet,
    interleaved,
    machine,
    median_and_range,
    ratios,
    run,
    table,
    ticks_per_second,
)

PARTS = ("bus", "drives", "law", "plant", "Zenoh", "record", "other")


def costs(scenario: str, n: int) -> dict[str, float]:
    """Wall time of a robot-tick, and processor time of each part of it [µs]."""
    summary = run(scenario, "--profile")
    shares = summary["profile_us_per_tick"].values()
    parts = {part: sum(share.get(part, 0.0) for share in shares) / n for part in PARTS}
    return {"wall": 1e6 / ticks_per_second(summary) / n} | parts


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    sizes = (2, 4, 8) if options.quick else (2, 4, 8, 16, 32)
    rounds, robot_seconds = (1, 4.0) if options.quick else (3, 16.0)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        cases = {
            f"{n}": partial(costs, fleet(folder, n, max(robot_seconds / n, 1.0)), n) for n in sizes
        }
        results = interleaved(rounds, cases)
    smallest = [value["wall"] for value in results[f"{sizes[0]}"]]
    rows = []
    for n, values in results.items():
        walls = [value["wall"] for value in values]
        rows.append(
            (
                n,
                median_and_range([1e6 / wall / int(n) for wall in walls]),
                median_and_range(walls),
                median_and_range(ratios(walls, smallest), ".2f"),
                *(f"{statistics.median(value[part] for value in values):.0f}" for part in PARTS),
            )
        )
    header = ("robots", "ticks per s", "µs a robot-tick", f"× that of {sizes[0]} robots")
    table((*header, *(f"{part}, µs CPU a robot-tick" for part in PARTS)), rows)


if __name__ == "__main__":
    main()
