"""The batch kernel of sweeps: robot-steps per second on one core, and what cases cost beside them.

    C            the same closed loop written in C (`sweep_kernel.c`), four signals kept
    kernel       `fleetloop.sweep.kernel`, the same scenario and signals, one call
    in process   the reference, all signals

A study of 1,000 cases of 4 robots and 250 steps that differ in a gain and a start:

    loop alone   the compiled loop, one case after the other, each as numbers already
    records      one call of the kernel, from scenarios to records
    rows         all that a worker does, from the study's draws to the rows of its dataset

Processor time of one thread. C and kernel are held against each other within each round, and their
results are compared; records and rows are held against the loop alone. Compiling is not measured:
the kernel's first call is made before, and a worker has its plan.

Not measured: worker processes, and how cases and rows travel.
"""

import ctypes
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
from configs.resolve import schedule
from configs.scenario import Scenario
from fleetloop.sweep.cases import cases_of
from fleetloop.sweep.kernel import run
from fleetloop.sweep.kernel.lowering import lowered
from fleetloop.sweep.kernel.outcome import columns
from fleetloop.sweep.kernel.reference import referred
from fleetloop.sweep.kernel.run import Loop
from fleetloop.sweep.plan import Base, Plan
from fleetloop.sweep.study import loads as study_of
from fleetloop.sweep.versions import versions_here
from fleetloop.sweep.work import work

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


STUDY = """
schema = 1
title = "gains and starts"
base = "paper"
design = "random"
cases = {count}
set = ["until_s=0.25", "expect.0.from_s=0.1", "expect.1.from_s=0.1", "expect.2.from_s=0.1",
       "expect.3.from_s=0.1"]

[[factor]]
key = "control.k4"
uniform = [1.0, 3.0]

[[factor]]
key = "robot.r1.pose.x_m"
uniform = [-9.0, -7.0]

[keep]
quantities = ["peak_x_e_m", "rms_torque_wheel_N_m"]
"""


class ManyCases:
    """A study of short cases."""

    def __init__(self, count: int) -> None:
        study = study_of("study.toml", STUDY.format(count=count))
        self._plan = Plan(study.to_toml(), Base.beside("study.toml", study.base))
        cases = cases_of(self._plan)
        self._numbers = tuple(range(count))
        self._scenarios = [cases.scenario(cases.case(n)) for n in self._numbers]
        self._asked = cases.quantities.signals
        self._robot_steps = ROBOTS * 250 * count

    def loop_alone(self) -> float:
        """Robot-steps per second of the compiled loop."""
        compiled, kept, prepared = Loop(), columns(self._asked), []
        for scenario in self._scenarios:
            ticks = schedule(scenario)
            room = [one.rows(ROBOTS, ticks.ticks, ticks.period_ns)[0] for one in kept]
            prepared.append((lowered(scenario, ticks), (room[0], room[1])))

        def work() -> None:
            for case, room in prepared:
                compiled.run(case, kept, room)

        return rate(self._robot_steps, work)

    def records(self) -> float:
        """Robot-steps per second from scenarios to records."""
        return rate(self._robot_steps, lambda: run(self._scenarios, self._asked, Stop()))

    def rows(self) -> float:
        """Robot-steps per second from draws to rows."""
        here = versions_here()
        return rate(self._robot_steps, lambda: work(self._plan, self._numbers, here, kernel=True))


def by_kernel(scenarios: list[Scenario]) -> object:
    """One call of the kernel."""
    return run(scenarios, SIGNALS, Stop())


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
    short, many = load("paper", ["until_s=0.5"]), ManyCases(count)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        in_c = LoopInC(Path(folder), scenario)
        print(
            f"largest differences from C over {seconds:g} s:", difference(in_c.run(ticks), scenario)
        )
        many.rows()
        measures = {
            "C": partial(rate, ROBOTS * ticks, partial(in_c.run, ticks)),
            "kernel": partial(rate, ROBOTS * ticks, partial(by_kernel, [scenario])),
            "in process": partial(rate, ROBOTS * 500, partial(referred, short, Stop(), "")),
            "loop alone": many.loop_alone,
            "records": many.records,
            "rows": many.rows,
        }
        results = interleaved(rounds, measures)
    names = list(results)
    _print(names[:3], results, "C", "x those of C")
    print(f"\n{count:,} cases of {ROBOTS} robots and 250 steps:")
    _print(names[3:], results, "loop alone", "x those of the loop alone")


def _print(names: list[str], results: dict[str, list[float]], beside: str, title: str) -> None:
    rows = [
        (
            name,
            median_and_range(results[name]),
            median_and_range(ratios(results[name], results[beside]), ".3f"),
        )
        for name in names
    ]
    table(("", "robot-steps per s", title), rows)


if __name__ == "__main__":
    main()
