"""Where a loaded scenario is from: its file, as far as changes of it need that."""

from collections.abc import Mapping
from typing import Any, NamedTuple


class Origin(NamedTuple):
    """A file."""

    source: str
    """The file, in messages."""
    folder: str
    """Where modules of one's own are looked for first; "" for the current one."""
    data: Mapping[str, Any]
    """What the file says: no defaults."""
