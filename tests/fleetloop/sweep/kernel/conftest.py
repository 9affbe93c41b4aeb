"""The kernel's tests: the first of them compiles the loop, which takes a busy machine a while."""

from pathlib import Path

import pytest

COMPILE_WITHIN_S = 600


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give the tests of this folder the time that compiling takes."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.timeout(COMPILE_WITHIN_S))
