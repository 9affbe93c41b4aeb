"""How far a machine carries a fleet of hundreds over processes, and that such a run holds.

The first so many robots of `hundred_tree` (100 Hz, shares at 20 Hz, poses at 50 Hz), and 249 in a
star at 1 kHz, near the schema's 256. Start-up is counted in the launcher up to the first tick,
ticks by wall time, memory as the sum of all processes' proportional set sizes, sampled while they
run; a stall is time in which the launcher was not given a processor. One run each: what disturbs
the machine is in the figures.

Not measured: more cores, several machines.
"""

import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
from common import arguments, machine, run, table, ticks_per_second

from configs.loading import load, to_toml

SAMPLE_EVERY_S = 2.0
STAR, STAR_S = 249, 0.1


def tree(folder: Path, robots: int, seconds: float) -> str:
    """The first robots of `hundred_tree`."""
    whole = load("hundred_tree")
    some = {"robot": whole.robot[:robots], "expect": (), "duration_s": seconds}
    return written(folder / f"tree_{robots}.toml", to_toml(whole.model_copy(update=some)))


def star(folder: Path, robots: int, seconds: float) -> str:
    """Robots abreast on a line; all hear the first."""
    lines = ["schema = 1", f'name = "star_{robots}"', f"duration_s = {seconds}"]
    lines += ["[path]", 'kind = "line"', "[graph]", 'generator = "star"']
    for k in range(robots):
        lines += ["[[robot]]", f'name = "r{k + 1}"', f"pose = {{ x_m = 0.0, y_m = {k}.0 }}"]
        lines += [f'offset = {{ kind = "world", y_m = {k}.0 }}']
    return written(folder / f"star_{robots}.toml", "\n".join(lines) + "\n")


def written(path: Path, text: str) -> str:
    """The path of a scenario file with this text."""
    path.write_text(text, "utf-8")
    return str(path)


@contextmanager
def memory_peak() -> Iterator[list[int]]:
    """Of this process's descendants, sampled until the end: the most bytes together."""
    peak, over, me = [0], threading.Event(), psutil.Process()

    def sample() -> None:
        while not over.wait(SAMPLE_EVERY_S):
            peak[0] = max(peak[0], sum(map(proportional_bytes, me.children(recursive=True))))

    sampler = threading.Thread(target=sample)
    sampler.start()
    try:
        yield peak
    finally:
        over.set()
        sampler.join()


def proportional_bytes(process: psutil.Process) -> int:
    """The proportional set size of a process, 0 if it has ended."""
    try:
        return int(process.memory_full_info().pss)
    except psutil.Error:
        return 0


def measured(scenario: str, robots: int) -> tuple[str, ...]:
    """A row of the table."""
    with memory_peak() as peak:
        summary: dict[str, Any] = run(scenario, "--force", "--allow-unchecked")
    rate = ticks_per_second(summary)
    return (
        Path(scenario).stem.partition("_")[0],
        f"{robots}",
        f"{summary['startup_s']:.1f}",
        f"{rate:.0f}",
        f"{rate * robots:,.0f}",
        f"{peak[0] / 1e6:,.0f}",
        f"{summary['machine']['longest_stall_s']:.2f}",
    )


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    sizes, seconds = ((25,), 2.0) if options.quick else ((25, 50, 75, 100), 5.0)
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = [measured(tree(folder, robots, seconds), robots) for robots in sizes]
        if not options.quick:
            rows.append(measured(star(folder, STAR, STAR_S), STAR))
    table(
        (
            "graph",
            "robots",
            "start-up s",
            "ticks per s",
            "robot-ticks per s",
            "memory MB",
            "longest stall s",
        ),
        rows,
    )


if __name__ == "__main__":
    main()
