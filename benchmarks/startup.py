"""From the command to the first tick, and from the last tick to the end, by number of robots.

Start-up is counted in the launcher once its own modules are imported; the whole command comes
besides. Medians, ranges, and ratios of the whole command to one robot within the same round.

Not measured: a cold disk cache, machines other than this one, other simulators' start-up.
"""

import tempfile
import time
from functools import partial

from common import arguments, fleet, interleaved, machine, median_and_range, ratios, run, table

SCENARIO_S = 0.5


def times(scenario: str) -> dict[str, float]:
    """Start-up, teardown and the whole command [s]."""
    began = time.perf_counter()
    summary = run(scenario)
    whole = time.perf_counter() - began
    return {"start-up": summary["startup_s"], "teardown": summary["teardown_s"], "whole": whole}


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


if __name__ == "__main__":
    main()
