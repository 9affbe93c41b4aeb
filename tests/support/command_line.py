"""The command line in the test's own process, where a test is about a verb and not its start."""

import os
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from bridge.network.zenoh_link import ZenohLink
from fleetloop.cli import main


class Done(NamedTuple):
    """The result of a command, named as in `subprocess.CompletedProcess`."""

    returncode: int
    stdout: str
    stderr: str


def fleetloop(folder: Path, *words: str) -> Done:
    """Do `fleetloop WORDS` in a folder."""
    status = 0
    out, err = (TextIOWrapper(BytesIO(), "utf-8", write_through=True) for _ in range(2))
    with (
        chdir(folder),
        redirect_stdout(out),
        redirect_stderr(err),
        patch.dict(os.environ, COLUMNS="100"),
        patch.object(sys, "argv", ["fleetloop", *words]),
        patch.object(sys, "path", [*sys.path]),
        # A session of another test that did not close in time would end this process.
        patch.object(ZenohLink, "stuck", new=False),
    ):
        try:
            main()
        except SystemExit as ended:
            status = int(ended.code or 0)
    return Done(status, *(stream.buffer.getvalue().decode() for stream in (out, err)))
