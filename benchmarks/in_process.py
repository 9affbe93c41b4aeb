"""The in-process reference: robot-ticks per second, everything but network and bus.

Each robot-tick is the law, both drives' codecs, the physics and the record of all signals. Medians,
ranges, and ratios to one robot within the same round.

Not measured: start-up, the processes and the network of a real run, other simulators.
"""

import tempfile
from functools import partial
from pathlib import Path

from common import arguments, fleet, interleaved, machine, median_and_range, ratios, run, table


def robot_ticks(scenario: str, n: int, checkout: Path | None = None) -> float:
    """Robot-ticks per second of an in-process run."""
    summary = run(scenario, "--in-process", checkout=checkout)
    return float(n * summary["ticks"] / summary["wall_s"])


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__, against=True)
    rounds, seconds = (1, 2.0) if options.quick else (5, 10.0)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        cases = {
            f"{n}": partial(robot_ticks, fleet(folder, n, seconds * 4 / n), n) for n in (1, 4, 16)
        }
        for checkout in options.against:
            cases[f"4 in {checkout}"] = partial(robot_ticks, fleet(folder, 4, seconds), 4, checkout)
        results = interleaved(rounds, cases)
    rows = [
        (n, median_and_range(values), median_and_range(ratios(values, results["1"]), ".2f"))
        for n, values in results.items()
    ]
    table(("robots", "robot-ticks per s", "× those of one robot"), rows)


if __name__ == "__main__":
    main()
