"""The batch kernel of sweeps: robot-steps per second on one core, and what cases cost beside them.

    C            the same closed loop written in C (`sweep_kernel.c`), four signals kept
    kernel       `fleetloop.sweep.kernel`, the same scenario and signals, one call
    in process   the reference, all signals
    1,000 cases  of 4 robots and 250 steps that differ in gains and starts: robot-steps per second
                 of one call of the kernel with all of them, from scenarios to records

Processor time of one thread. C and kernel are held against each other within each round, and their
results are compared. Compiling is not measured: the kernel's first call is made before.

Not measured: worker processes, the making of scenarios, what is done with the records.
"""

import ctypes
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from common import arguments, interleaved, machine, median_and_range, ratios, table
from numpy.typing import NDArray

from agents.coordination import period_map
from bridge.process.lifecycle import Stop
from configs.loading import load
from configs.scenario import Scenario
from fleetloop.sweep.kernel import run
from fleetloop.sweep.kernel.reference import referred

SIGNALS = ("s", "x_e_m", "y_e_m", "tau_right_wheel_N_m")
ROBOTS = 4


class LoopInC:
    """The loop of `sweep_kernel.c`, compiled into a folder."""

    def __init__(self, folder: Path, scenario: Scenario) -> None:
        compiler = shutil.which("cc")
        if compiler is None:
            sys.exit("no C compiler (cc)")
        library = folder / "libloop.so"
        source = Path(__file__).with_suffix(".c")
        options = ["-O2", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run([compiler, *options, "-o", library, source, "-lm"], check=True, timeout=120)
        self._simulate = ctypes.CDLL(str(library)).simulate
        poses = [robot.pose for robot in scenario.robot]
        self._starts = np.array([(pose.x_m, pose.y_m, pose.theta_rad) for pose in poses])
        kinds = [period_map(2.0, 1.0, degree, 1.0 - degree, 0.001) for degree in (0.0, 1.0)]
        self._maps = np.array([[number for part in one for number in part] for one in kinds])

    def run(self, ticks: int) -> NDArray[np.float64]:
        """The four signals by robot and tick."""
        kept = np.zeros((ROBOTS, ticks, len(SIGNALS)))
        v_r = ctypes.c_double(0.6)
        arrays = [_pointer(it) for it in (self._starts, self._maps)]
        self._simulate(ctypes.c_int(ticks), *arrays, v_r, _pointer(kept))
        return kept


def _pointer(array: NDArray[np.float64]) -> object:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def rate(robot_steps: int, work: Callable[[], object]) -> float:
    """Robot-steps per second of processor time."""
    begun = time.process_time()
    work()
    return robot_steps / (time.process_time() - begun)


def by_kernel(scenarios: list[Scenario]) -> object:
    """One call of the kernel."""
    return run(scenarios, SIGNALS, Stop())


def cases(count: int) -> list[Scenario]:
    """Of four robots and 250 steps, with gains and starts of their own."""
    base, draw = load("paper", ["until_s=0.25"]), random.Random(1).uniform
    return [
        base.with_({"control.k4": draw(1.0, 3.0), "robot.r1.pose.x_m": draw(-9.0, -7.0)})
        for _ in range(count)
    ]


def difference(c: NDArray[np.float64], scenario: Scenario) -> str:
    """The largest difference of each signal between the kernel and C."""
    (outcome,) = run([scenario], SIGNALS, Stop())
    found = []
    for column, name in enumerate(SIGNALS):
        rows = np.array([outcome.record.controller[robot][name] for robot in scenario.names])
        found.append(f"{name} {np.abs(rows - c[:, :, column]).max():.1e}")
    return ", ".join(found)


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    rounds, seconds, count = (1, 5.0, 100) if options.quick else (5, 30.0, 1000)
    scenario = load("paper", [f"until_s={seconds}"])
    ticks = round(seconds * 1000)
    short, many = load("paper", ["until_s=0.5"]), cases(count)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        in_c = LoopInC(Path(folder), scenario)
        print(
            f"largest differences from C over {seconds:g} s:", difference(in_c.run(ticks), scenario)
        )
        by_kernel(many[:1])
        measures = {
            "C": partial(rate, ROBOTS * ticks, partial(in_c.run, ticks)),
            "kernel": partial(rate, ROBOTS * ticks, partial(by_kernel, [scenario])),
            f"{count:,} cases": partial(rate, ROBOTS * 250 * count, partial(by_kernel, many)),
            "in process": partial(rate, ROBOTS * 500, partial(referred, short, Stop(), "")),
        }
        results = interleaved(rounds, measures)
    rows = [
        (name, median_and_range(values), median_and_range(ratios(values, results["C"]), ".3f"))
        for name, values in results.items()
    ]
    table(("", "robot-steps per s", "x those of C"), rows)


if __name__ == "__main__":
    main()
