"""Reading a record into arrays, by Fleetloop and by the `mcap` package.

    Fleetloop      Record.open: every row of every robot as numpy arrays, every byte checked
    mcap           make_reader(...).iter_messages with check sums: no array, nothing decoded
    mcap, decoded  the same with mcap-ros2-support's decoder, each message as an object

Processor time of one process; the ratio to Fleetloop within the same round. All of them read the
rows of `paper` from a file that is in the page cache.

Not measured: disks.
"""

import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from common import arguments, interleaved, machine, median_and_range, ratios, table
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from fleetloop.record.reader import Record


def fleetloop(path: Path) -> float:
    """Processor time [s] of reading all rows."""
    began = time.process_time()
    Record.open(path)
    return time.process_time() - began


def stock(path: Path, *, decoded: bool) -> float:
    """Processor time [s] of reading all messages of rows."""
    robots = Record.open(path).robots
    topics = [f"robot/{robot}/{kind}" for robot in robots for kind in ("plant", "controller")]
    began = time.process_time()
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        messages = reader.iter_decoded_messages if decoded else reader.iter_messages
        for _ in messages(topics=topics):
            pass
    return time.process_time() - began


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    rounds, seconds = (1, 2.0) if options.quick else (5, 10.0)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        words = ("run", "paper", "--in-process", "--no-report", "--json", "--duration", seconds)
        command = [sys.executable, "-m", "fleetloop", *map(str, words), "--out", str(run)]
        subprocess.run(command, capture_output=True, timeout=600)
        path = run / "record.mcap"
        cases = {
            "Fleetloop": partial(fleetloop, path),
            "mcap": partial(stock, path, decoded=False),
            "mcap, decoded": partial(stock, path, decoded=True),
        }
        results = interleaved(rounds, cases)
    rows = [
        (
            name,
            median_and_range(values, ".2f"),
            median_and_range(ratios(values, results["Fleetloop"]), ".1f"),
        )
        for name, values in results.items()
    ]
    table(("reader", "processor time [s]", "× Fleetloop's"), rows)


if __name__ == "__main__":
    main()
