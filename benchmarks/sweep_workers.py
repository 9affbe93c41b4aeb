"""A study of short cases over workers: what a second processor brings, and the kernel.

    1 worker, 2 workers    `fleetloop sweep` with the batch kernel
    reference              `fleetloop sweep --in-process` with 2 workers, compiled modules
    Dask alone             the uncompiled reference as a task per case on 2 Dask workers

Four robots, 250 steps a case, as in `sweep_kernel.py`. The rate is of cases per second of wall time
from the first case's start to the last row; the whole command, with imports, workers and their end,
comes besides. With the kernel 4,000 cases are computed: of fewer, the start of the workers, about
3 s, would hide what a second one brings. The two without the kernel compute 60.

Not measured: other runners (a raw loop over this machine's processors has no resumption, no rows),
more processors than two, workers of other machines.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from common import arguments, interleaved, machine, median_and_range, ratios, table
from sweep_kernel import STUDY

MANY, FEW = 4000, 60


def sweep(folder: Path, cases: int, workers: int, *options: str) -> dict[str, float]:
    """Cases per second, and the whole command's wall time [s]."""
    path = folder / f"{cases}.toml"
    path.write_text(STUDY.format(count=cases), "utf-8")
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        out = Path(scratch) / "out"
        words = [str(path), "--out", str(out), "--workers", str(workers), *options]
        began = time.perf_counter()
        command = [sys.executable, "-m", "fleetloop", "sweep", *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
        whole_s = time.perf_counter() - began
        told = json.loads((out / "sweep.json").read_text("utf-8"))
        return {"rate": told["computed"] / told["wall_s"], "whole": whole_s}


def dask_alone(cases: int) -> dict[str, float]:
    """The same with nothing but Dask and the reference, in a process of its own."""
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, __file__, "--dask-alone", str(cases)],
        capture_output=True,
        text=True,
        timeout=600,
        env=os.environ | {"FLEETLOOP_PURE": "1"},
    )
    if done.returncode != 0:
        sys.exit(done.stderr)
    rate = float(done.stdout.splitlines()[-1])
    return {"rate": rate, "whole": time.perf_counter() - began}


def _case(number: int) -> float:
    """A case's peak of x_e of the first robot [m]; imports are a worker's, once."""
    from bridge.process.lifecycle import Stop
    from configs.loading import load
    from fleetloop.sweep.kernel.reference import referred

    start = f"robot.r1.pose.x_m={-9.0 + 0.002 * number}"
    outcome = referred(load("paper", ["until_s=0.25", start]), Stop(), "")
    return max(abs(x) for x in outcome.record.controller["r1"]["x_e_m"])


def _dask_alone(cases: int) -> None:
    """Print the cases per second."""
    import distributed

    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    )
    with cluster, distributed.Client(cluster) as client:
        client.gather(client.map(_case, range(-4, 0)))  # imports
        began = time.perf_counter()
        client.gather(client.map(_case, range(cases)))
        print(cases / (time.perf_counter() - began))


def main() -> None:
    """Measure and print."""
    if sys.argv[1:2] == ["--dask-alone"]:
        _dask_alone(int(sys.argv[2]))
        return
    options = arguments(__doc__)
    rounds, count, few = (1, 200, 20) if options.quick else (5, MANY, FEW)
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sweep(folder, 8, 1)  # compiles the kernel where it isn't
        measures = {
            "1 worker": partial(sweep, folder, count, 1),
            "2 workers": partial(sweep, folder, count, 2),
            "reference": partial(sweep, folder, few, 2, "--in-process"),
            "Dask alone": partial(dask_alone, few),
        }
        results = interleaved(rounds, measures)
    rates = {what: [value["rate"] for value in values] for what, values in results.items()}
    rows = [
        (
            what,
            str(count if "worker" in what else few),
            median_and_range(rates[what], ".1f"),
            median_and_range(ratios(rates[what], rates["Dask alone"]), ".1f"),
            median_and_range(ratios(rates[what], rates["1 worker"]), ".2f"),
            median_and_range([value["whole"] for value in values], ".1f"),
        )
        for what, values in results.items()
    ]
    titles = ("cases per s", "x Dask alone", "x 1 worker", "whole command s")
    table(("", "cases", *titles), rows)


if __name__ == "__main__":
    main()
