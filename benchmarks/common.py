"""What the benchmarks share: runs of Fleetloop as a user starts them, fleets, tables."""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T", float, dict[str, float])


def arguments(text: str, *, against: bool = False) -> argparse.Namespace:
    """--quick, and --against where it is offered, with the script's docstring as its help."""
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="one short round, for a first look: no ranges"
    )
    if against:
        parser.add_argument(
            "--against",
            action="append",
            default=[],
            type=Path,
            metavar="FOLDER",
            help="another checkout, set up there by `uv sync`; may be repeated",
        )
    options = parser.parse_args()
    for checkout in options.against if against else ():
        if not _python(checkout).is_file():
            parser.error(f"--against {checkout}: no {_python(checkout)}; `uv sync` there makes it")
    return options


def _python(checkout: Path) -> Path:
    return checkout.absolute() / ".venv" / "bin" / "python"


def run(scenario: str, *options: str, checkout: Path | None = None) -> dict[str, Any]:
    """The summary of a run over processes (or as `options` say), nothing else printed.

    `checkout`: of another version, with its own environment.
    """
    python = sys.executable if checkout is None else str(_python(checkout))
    with tempfile.TemporaryDirectory() as folder:
        command = [python, "-m", "fleetloop", "run", scenario, "--json", "--no-report"]
        done = subprocess.run(
            [*command, "--out", f"{folder}/run", *options],
            capture_output=True,
            text=True,
            timeout=600,
            cwd=checkout,
        )
        if done.returncode not in (0, 1):
            sys.exit(
                f"{' '.join(command)} ended with {done.returncode}: {done.stderr}{done.stdout}"
            )
        summary: dict[str, Any] = json.loads(done.stdout)
        return summary


def ticks_per_second(summary: dict[str, Any]) -> float:
    """Control ticks per second of wall time."""
    return float(summary["ticks"] / summary["wall_s"])


def fleet(folder: str, n: int, seconds: float, **clock: object) -> str:
    """A scenario file: n robots abreast on a cosine, who hears whom is a ring; its path."""
    lines = ["schema = 1", f'name = "ring_{n}"', f"duration_s = {seconds}", "[clock]"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in clock.items()]
    lines += ["[graph]", 'generator = "ring"', "[coordination]", "v_hat_0 = 0.6"]
    if clock.get("mode") == "realtime":
        lines += ["[control]", 'law = "adaptive_dsc_robust"', "k4 = 0.36"]
        lines += [f"gamma_{k}_s = 0.02" for k in (1, 2, 3)]
    for k in range(n):
        lines += ["[[robot]]", f'name = "r{k + 1}"', f"pose = {{ x_m = -3.5, y_m = {1.0 + k} }}"]
        lines += [f'offset = {{ kind = "world", y_m = {float(k)} }}']
    path = Path(folder) / f"ring_{n}.toml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return str(path)


def interleaved(rounds: int, cases: Mapping[str, Callable[[], T]]) -> dict[str, list[T]]:
    """Every case once per round, in turn: what disturbs the machine disturbs all of them."""
    results: dict[str, list[T]] = {name: [] for name in cases}
    for number in range(rounds):
        for name, measure in cases.items():
            results[name].append(measure())
            sys.stderr.write(
                f"round {number + 1} of {rounds}: {name}: {_shown(results[name][-1])}\n"
            )
    return results


def _shown(value: float | dict[str, float]) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {part:,.2f}" for name, part in value.items())
    return f"{value:,.1f}"


def ratios(a: Sequence[float], b: Sequence[float]) -> list[float]:
    """Of a to b, each within one round."""
    return [x / y for x, y in zip(a, b, strict=True)]


def median_and_range(values: Sequence[float], form: str = ",.0f") -> str:
    """The median, and in brackets the least and the most of several rounds."""
    middle = f"{statistics.median(values):{form}}"
    if len(values) == 1:
        return middle
    return f"{middle} ({min(values):{form}} to {max(values):{form}})"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A Markdown table, as the README has it."""
    widths = [max(len(row[n]) for row in (header, *rows)) for n in range(len(header))]
    for row in (header, ["-" * width for width in widths], *rows):
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        print("| " + " | ".join(cells) + " |")


def machine() -> str:
    """One line on where this was measured."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line for line in cpuinfo.read_text().splitlines() if "model name" in line]
        model = names[0].partition(":")[2].strip() if names else model
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}"
