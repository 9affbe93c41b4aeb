"""Cost of a lockstep tick by the number of robots, and where it goes.

Processor time by part comes from `fleetloop run --profile`: bus with its system calls, Zenoh with
its threads and the router, record with the recorder's process. The ring has an edge per robot, so a
linear cost is what to expect. Not measured: other graphs, more cores.
"""

import tempfile

from common import arguments, fleet, machine, run, table, ticks_per_second

PARTS = ("bus", "drives", "law", "plant", "Zenoh", "record", "other")


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    sizes = (2, 4, 8) if options.quick else (2, 4, 8, 16, 32)
    print(machine())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for n in sizes:
            seconds = (4.0 if options.quick else 16.0) / n
            summary = run(fleet(folder, n, max(seconds, 1.0)), "--profile")
            shares = summary["profile_us_per_tick"].values()
            parts = [sum(share.get(part, 0.0) for share in shares) for part in PARTS]
            rate = ticks_per_second(summary)
            rows.append(
                (
                    f"{n}",
                    f"{rate:,.0f}",
                    f"{1e6 / rate:,.0f}",
                    f"{1e6 / rate / n:,.0f}",
                    *(f"{part / n:.0f}" for part in parts),
                )
            )
    header = ("robots", "ticks per s", "µs a tick", "µs a robot-tick")
    table((*header, *(f"{part}, µs CPU a robot-tick" for part in PARTS)), rows)


if __name__ == "__main__":
    main()
