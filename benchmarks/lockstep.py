"""Lockstep over processes against the raw barrier, and against co-simulators that are installed.

A round of the peers: one plant sends 4 doubles to each of N controllers, each sends 2 back. Nothing
else happens in them. A tick of Fleetloop does that over python-can, and the law, the physics, two
emulated drives per robot, Zenoh with access control, and a record of every signal.

Not measured: other peers' richer features, networks, more than one machine.
"""

import statistics
from functools import partial

from barrier import rounds_per_second
from common import arguments, fleet, interleaved, machine, ratio, run, table, ticks_per_second
from peers import available_peers


def fleetloop(scenario: str, seconds: float) -> float:
    """Ticks per second of a run."""
    return ticks_per_second(run(scenario, "--duration", str(seconds)))


def main() -> None:
    """Measure and print."""
    import tempfile

    options = arguments(__doc__)
    rounds, seconds = (1, 1.0) if options.quick else (5, 2.0)
    print(machine())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for n in (4, 16):
            scenario = "paper" if n == 4 else fleet(folder, n, 30.0)
            cases = {
                "raw barrier, one core": partial(rounds_per_second, n, seconds, pinned=True),
                "raw barrier, free": partial(rounds_per_second, n, seconds, pinned=False),
                "Fleetloop": partial(fleetloop, scenario, 5 * seconds if n == 4 else seconds),
            }
            cases |= {
                name: partial(measure, n, seconds) for name, measure in available_peers().items()
            }
            results = interleaved(rounds, cases)
            for name, values in results.items():
                rows.append(
                    (
                        f"{n}",
                        name,
                        f"{statistics.median(values):,.0f}",
                        f"{min(values):,.0f} to {max(values):,.0f}",
                        f"{ratio(results['Fleetloop'], values):.2f}",
                    )
                )
    table(("robots", "", "rounds or ticks per s", "range", "Fleetloop is × this"), rows)


if __name__ == "__main__":
    main()
