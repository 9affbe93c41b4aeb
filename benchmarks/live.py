"""The cost of a live page: lockstep `paper` as fast as it goes, without and with a reader.

The browser is elsewhere: a process at nice 19 reads the page and draws nothing. A round is a run
of each kind, in turn; the ratio of ticks per second is that within a round. Start-up of the viewer
is in it: the page is asked for when the run begins. Frames per second are those that the reader
answered.

Not measured: a browser on the same machine, several viewers.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from common import (
    arguments,
    interleaved,
    machine,
    median_and_range,
    ratios,
    run,
    table,
    ticks_per_second,
)

READER = Path(__file__).with_name("page_reader.py")
END_S = 30.0
ALONE, READ = "no page", "page that is read"


def alone(seconds: float) -> dict[str, float]:
    """A run without a page."""
    return {"ticks per s": ticks_per_second(run("paper", *_options(seconds)))}


def read(seconds: float) -> dict[str, float]:
    """A run with a page that is read from its beginning."""
    with subprocess.Popen([sys.executable, READER], stdout=subprocess.PIPE, text=True) as reader:
        try:
            ticks_per_s = ticks_per_second(run("paper", *_options(seconds)))
            said, _ = reader.communicate(timeout=END_S)
        finally:
            reader.kill()
    heard = json.loads(said)
    rate = (heard["frames"] - 1) / heard["seconds"] if heard["frames"] > 1 else 0.0
    return {"ticks per s": ticks_per_s, "frames per s": rate, "frames": heard["frames"]}


def _options(seconds: float) -> tuple[str, ...]:
    return ("--duration", str(seconds), "--set", "expect=[]")


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    rounds, seconds = (1, 20.0) if options.quick else (7, 60.0)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["FLEETLOOP_RUNTIME"] = folder  # the reader's run is the only one
        print(machine())
        results = interleaved(rounds, {ALONE: lambda: alone(seconds), READ: lambda: read(seconds)})
    ticks = {name: [one["ticks per s"] for one in found] for name, found in results.items()}
    frames = [one["frames per s"] for one in results[READ]]
    slower = [1.0 - ratio for ratio in ratios(ticks[READ], ticks[ALONE])]
    table(
        ("paper, lockstep", "ticks per s", "slower", "frames per s"),
        (
            (ALONE, median_and_range(ticks[ALONE]), "", ""),
            (
                READ,
                median_and_range(ticks[READ]),
                median_and_range(slower, ".1%"),
                median_and_range(frames, ".1f"),
            ),
        ),
    )


if __name__ == "__main__":
    main()
