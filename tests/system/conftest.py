"""Fixtures of tests over processes."""

from collections.abc import Iterator

import pytest
from support.elsewhere import Agent


@pytest.fixture
def agents() -> Iterator[list[Agent]]:
    """Roles on other machines that a test has started; ended with it."""
    started: list[Agent] = []
    yield started
    for agent in started:
        agent.kill()
