"""Lockstep over processes against the raw barrier, and against co-simulators that are installed.

A round of the peers: one plant sends 4 doubles to each of N controllers, each sends 2 back. Nothing
else happens in them. A tick of Fleetloop does that over python-can, and the law, the physics, two
emulated drives per robot, Zenoh with access control, and a record of every signal. The scenario
`realistic` has bit timing, motors, encoders and supplies beside that, at 200 Hz; no peer has.

Every case runs once per round, in turn. Medians, ranges, and Fleetloop's ratio to each within the
same round; to the best of the peers too, whichever that is in a round.

Peers that are installed take part (`uv sync` removes them again; mosaik 3.7 needs Python 3.12):

    uv pip install 'helics==3.6.1' 'mosaik<=3.7.1' 'dora-rs==1.1.0' 'dora-rs-cli==1.1.0'

Not measured: start-up, peers' richer features, peers in other languages than Python or pinned to
one core, networks, more than one machine.
"""

import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import barrier
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
from peers import Peers, available_peers

OURS = "Fleetloop"
SIZES = (4, 16)


def fleetloop(scenario: str, seconds: float, checkout: Path | None = None) -> float:
    """Ticks per second of a run."""
    options = ("--duration", str(seconds), "--set", "expect=[]")
    return ticks_per_second(run(scenario, *options, checkout=checkout))


def measured(
    n: int, rounds: int, seconds: float, peers: Peers, against: Sequence[Path]
) -> dict[str, list[float]]:
    """Rounds or ticks per second with N controllers, by case."""
    with tempfile.TemporaryDirectory() as folder:
        scenario = "paper" if n == 4 else fleet(folder, n, 30.0)
        cases: dict[str, Callable[[], float]] = {
            "raw barrier, one core": partial(barrier.rounds_per_second, n, seconds, pinned=True),
            "raw barrier, free": partial(barrier.rounds_per_second, n, seconds, pinned=False),
            OURS: partial(fleetloop, scenario, 5 * seconds if n == 4 else seconds),
        }
        cases |= _in_others(against, scenario, 5 * seconds if n == 4 else seconds)
        cases |= {name: partial(measure, n, seconds) for name, measure in peers.items()}
        return interleaved(rounds, cases)


def measured_realistic(
    rounds: int, seconds: float, against: Sequence[Path]
) -> dict[str, list[float]]:
    """Ticks per second of the scenario `realistic`, by case."""
    ours: dict[str, Callable[[], float]] = {OURS: partial(fleetloop, "realistic", seconds)}
    return interleaved(rounds, ours | _in_others(against, "realistic", seconds))


def _in_others(
    against: Sequence[Path], scenario: str, seconds: float
) -> dict[str, Callable[[], float]]:
    """The same run in other checkouts."""
    return {
        f"{OURS} in {checkout}": partial(fleetloop, scenario, seconds, checkout)
        for checkout in against
    }


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__, against=True)
    rounds, seconds = (1, 1.0) if options.quick else (5, 2.0)
    print(machine())
    peers = available_peers()
    rows: list[tuple[str, str, str, str]] = []
    for n in SIZES:
        results = measured(n, rounds, seconds, peers, options.against)
        if peers:
            best = [max(values) for values in zip(*(results[name] for name in peers), strict=True)]
            results[f"the best of {', '.join(peers)}"] = best
        rows += _rows(f"{n}", results)
    rows += _rows("4, realistic", measured_realistic(rounds, 10 * seconds, options.against))
    table(("robots", "", "rounds or ticks per s", "Fleetloop is × this"), rows)


def _rows(robots: str, results: dict[str, list[float]]) -> list[tuple[str, str, str, str]]:
    return [
        (
            robots,
            name,
            median_and_range(values),
            median_and_range(ratios(results[OURS], values), ".2f"),
        )
        for name, values in results.items()
    ]


if __name__ == "__main__":
    main()
