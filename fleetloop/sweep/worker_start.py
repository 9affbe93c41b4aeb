"""What a worker on this machine does first: what it prints goes to the file of Dask's messages."""

import os
from typing import Any

LOG = "FLEETLOOP_SWEEP_LOG"
"""Environment variable: the file."""


def dask_setup(_worker: Any) -> None:
    """Called by Dask in a worker's process when it starts."""
    if path := os.environ.get(LOG):
        log = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        for stream in (1, 2):
            os.dup2(log, stream)
        os.close(log)
