"""The in-process reference: robot-ticks per second, everything but network and bus.

Each robot-tick is the law, both drives' codecs, the physics and the record of all signals. Not
measured: start-up.
"""

import statistics
import tempfile
from functools import partial

from common import arguments, fleet, interleaved, machine, run, table


def robot_ticks(scenario: str, n: int) -> float:
    """Robot-ticks per second of an in-process run."""
    summary = run(scenario, "--in-process")
    return float(n * summary["ticks"] / summary["wall_s"])


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    rounds, seconds = (1, 2.0) if options.quick else (5, 10.0)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        cases = {
            f"{n}": partial(robot_ticks, fleet(folder, n, seconds * 4 / n), n) for n in (1, 4, 16)
        }
        results = interleaved(rounds, cases)
    rows = [
        (n, f"{statistics.median(values):,.0f}", f"{min(values):,.0f} to {max(values):,.0f}")
        for n, values in results.items()
    ]
    table(("robots", "robot-ticks per s", "range"), rows)


if __name__ == "__main__":
    main()
