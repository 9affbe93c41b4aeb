"""The batch kernel: the closed loop of many cases, compiled from the sources of the processes.

    lacks    why it can't run a scenario, "" if it can
    run      many scenarios, one after the other; what comes of each is as of a run in process

Its records are those of `fleetloop run --in-process`, bit for bit: it runs the same functions, in
the same order, on the same numbers. The functions are taken out of their sources as they stand
(`linking`), so there is no second text of any equation, and compiled by numba (`compilation`).
"""

from fleetloop.sweep.kernel.coverage import lacks
from fleetloop.sweep.kernel.outcome import KernelOutcome
from fleetloop.sweep.kernel.run import run

__all__ = ["KernelOutcome", "lacks", "run"]
