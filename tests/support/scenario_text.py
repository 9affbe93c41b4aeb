"""Scenario files with some keys changed, as a person would change them in the file."""

import tomllib

import tomli_w

from configs.errors import Complaint
from configs.overrides import Override


def changed(text: str, *changes: str) -> str:
    """The file with these `key=value` changes in it."""
    data = tomllib.loads(text)
    for change in changes:
        override = Override.from_set(change)
        assert isinstance(override, Override), override
        assert not isinstance(override.apply(data), Complaint), change
    return tomli_w.dumps(data)
