"""Zenoh's own router, as `zenohd -c FILE` is: a process that knows its configuration file only."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PROGRAM = """
import sys, zenoh
with zenoh.open(zenoh.Config.from_file(sys.argv[1])) as session:
    print("routes", flush=True)
    sys.stdin.read()
"""


class StockRouter:
    def __init__(self, config: Path, *before: str) -> None:
        """`before`: words before the command, as `ip netns exec HOST`."""
        self._process = subprocess.Popen(
            [*before, sys.executable, "-c", PROGRAM, str(config)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout is not None
        if self._process.stdout.readline() != "routes\n":
            _, said = self._process.communicate(timeout=10.0)
            raise AssertionError(said)

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()


@contextmanager
def stock_router(config: Path) -> Iterator[StockRouter]:
    router = StockRouter(config)
    try:
        yield router
    finally:
        router.kill()
