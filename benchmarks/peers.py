"""Co-simulators that a user might take instead, measured on the barrier when they are installed.

    pip install helics mosaik      each is left out when it isn't there

Each is driven as its documentation shows: one process per participant, values exchanged at every
step. What a step carries is the barrier's: 4 doubles out, 2 doubles back.
"""

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent


def available_peers() -> dict[str, Callable[[int, float], float]]:
    """Measurements by name, of the peers that are installed."""
    found = {}
    for name in ("helics", "mosaik"):
        if importlib.util.find_spec(name) is not None:
            found[name] = partial(_measure, f"peer_{name}.py")
        else:
            sys.stderr.write(f"{name} is not installed: left out\n")
    return found


def _measure(script: str, n: int, seconds: float) -> float:
    """Rounds per second: two runs of different length, so that start-up cancels out."""
    few = 50
    rough = _seconds(script, n, few)
    many = few + max(50, int(few * seconds / max(rough, 0.01)))
    first, second = _seconds(script, n, few), _seconds(script, n, many)
    return (many - few) / max(second - first, 1e-3)


def _seconds(script: str, n: int, rounds: int) -> float:
    done = subprocess.run(
        [sys.executable, str(HERE / script), str(n), str(rounds)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    if done.returncode:
        sys.exit(f"{script} failed: {done.stderr}")
    return float(done.stdout.split()[-1])
