"""A small scenario file, and files with some keys changed, as a person would change them."""

import tomllib

import pytest
import tomli_w

from configs.errors import Complaint, ScenarioError
from configs.loading import loads
from configs.overrides import Override

SMALL = """
schema = 1
name = "small"
[[robot]]
name = "r1"
pose = { x_m = 0.0, y_m = 1.0 }
[[robot]]
name = "r2"
pose = { x_m = 0.0, y_m = 2.0 }
"""
"""Two robots, all else as it is by default."""


def changed(text: str, *changes: str) -> str:
    """The file with these `key=value` changes in it."""
    data = tomllib.loads(text)
    for change in changes:
        override = Override.from_set(change)
        assert isinstance(override, Override), override
        assert not isinstance(override.apply(data), Complaint), change
    return tomli_w.dumps(data)


def problems(text: str, *changes: str) -> list[str]:
    """The lines that refuse a file with these changes."""
    with pytest.raises(ScenarioError) as caught:
        loads("file.toml", changed(text, *changes))
    assert caught.value.exit_status == 2
    return str(caught.value).splitlines()
