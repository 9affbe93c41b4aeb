"""Descriptors of any number are waited for."""

import os
import subprocess
import sys

SCRIPT = """
import os, resource
from bridge.process.waiting import readable
resource.setrlimit(resource.RLIMIT_NOFILE, (2048, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
read, write = os.pipe()
high = os.dup2(read, 1500)
print(readable([high], 0.01), readable([read, high], 0.0))
os.write(write, b"x")
print(readable([high], 10.0), readable([read], 10.0))
"""


def test_a_number_that_select_does_not_know_is_waited_for() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=30, env=os.environ
    )
    assert done.stdout.split() == ["False", "False", "True", "True"], done.stderr
