"""From the command to the first tick, and from the last tick to the end, by number of robots.

Start-up is counted in the launcher once its own modules are imported; the whole command comes
besides. Not measured: a cold disk cache.
"""

import statistics
import tempfile
import time

from common import arguments, fleet, machine, run, table


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    rounds = 1 if options.quick else 5
    print(machine())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for n in (1, 4, 16):
            scenario = fleet(folder, n, 0.5)
            summaries, whole = [], []
            for _ in range(rounds):
                began = time.perf_counter()
                summaries.append(run(scenario))
                whole.append(time.perf_counter() - began)
            rows.append(
                (
                    f"{n}",
                    f"{statistics.median(s['startup_s'] for s in summaries):.2f}",
                    f"{statistics.median(s['teardown_s'] for s in summaries):.2f}",
                    f"{statistics.median(whole):.2f}",
                )
            )
    table(("robots", "start-up s", "teardown s", "whole command s (0.5 s of scenario)"), rows)


if __name__ == "__main__":
    main()
