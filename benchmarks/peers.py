"""Co-simulators that a user might take instead, measured on the barrier when they are installed.

Each is driven as its documentation shows: one process per participant, values exchanged at every
step, spread over the cores as the scheduler likes. What a step carries is the barrier's: 4 doubles
out, 2 doubles back. Each counts from when all participants are ready.
"""

import sys
from collections.abc import Callable
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from bounded import output_of

HERE = Path(__file__).resolve().parent
LIMIT_S = 300.0
FEW = 50
MARGIN = 1.3

PEERS = {
    "HELICS": ("peer_helics.py", ("helics",)),
    "mosaik": ("peer_mosaik.py", ("mosaik",)),
    "dora-rs": ("peer_dora.py", ("dora-rs", "dora-rs-cli")),
}
"""Script and packages of each."""

Peers = dict[str, Callable[[int, float], float]]
"""Name and version; takes controllers and seconds, gives rounds per second."""


def available_peers() -> Peers:
    """Those that are installed."""
    found: Peers = {}
    for name, (script, packages) in PEERS.items():
        try:
            versions = [version(package) for package in packages]
        except PackageNotFoundError as missing:
            sys.stderr.write(f"{name} is left out: {missing.name} is not installed (see --help)\n")
        else:
            found[f"{name} {versions[0]}"] = partial(rounds_per_second, script)
    return found


def rounds_per_second(script: str, n: int, seconds: float) -> float:
    """Of a run that takes at least as many seconds; shorter ones before only say how long it is."""
    rounds = FEW
    while (took := _seconds(script, n, rounds)) < seconds:
        rounds = int(rounds * MARGIN * seconds / took) + 1
    return rounds / took


def _seconds(script: str, n: int, rounds: int) -> float:
    command = [sys.executable, str(HERE / script), str(n), str(rounds)]
    return float(output_of(command, LIMIT_S).split()[-1])
