"""One scenario in a process of its own; it ends with the process that began it, however that ends.

    python -P -m fleetloop.suite.worker PARENT SOURCE OUT processes|in-process [KEY=VALUE ...]

prints the outcome as `fleetloop run --json` does.
"""

import ctypes
import os
import signal
import sys
from pathlib import Path

from configs.errors import ExitStatus
from fleetloop import packages, streams

_PR_SET_PDEATHSIG = 1


def main() -> int:
    """Run the scenario; its exit status."""
    parent, source, out, where, *overrides = sys.argv[1:]
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        return ExitStatus.INTERRUPTED
    packages.prefer_own()
    streams.settle()
    from fleetloop.launch.run import RunOptions, run_scenario

    options = RunOptions(
        in_process=where == "in-process",
        overrides=tuple(overrides),
        out=Path(out),
        as_json=True,
        figures=False,
    )
    return run_scenario(source, options)


if __name__ == "__main__":
    STATUS = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(STATUS)  # a session that hangs at its end keeps nobody waiting
