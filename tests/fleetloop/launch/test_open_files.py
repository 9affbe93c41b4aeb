"""The limit of open files: raised as far as the user may, and named when it is too low."""

import subprocess
import sys

ENSURE = """
import resource
from configs.errors import InfrastructureError
from fleetloop.launch import open_files
resource.setrlimit(resource.RLIMIT_NOFILE, ({soft}, {hard}))
try:
    open_files.ensure({roles})
    print(resource.getrlimit(resource.RLIMIT_NOFILE)[0])
except InfrastructureError as error:
    print(error)
"""


def ensured(soft: int, hard: int, roles: int) -> str:
    code = ENSURE.format(soft=soft, hard=hard, roles=roles)
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, timeout=30).stdout.strip()


def test_the_soft_limit_is_raised_to_the_hard_one() -> None:
    assert ensured(200, 2000, roles=251) == "2000"


def test_the_largest_fleet_fits_into_the_usual_limit() -> None:
    assert ensured(1024, 1024, roles=256 + 2) == "1024"


def test_a_limit_that_is_too_low_is_named_with_what_is_needed() -> None:
    text = ensured(500, 500, roles=251)
    assert "251 processes need 817 open files at once, the limit of this user is 500" in text
    assert "ulimit -n 817" in text
