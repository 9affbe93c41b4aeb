"""Where a loaded scenario is from: its file, as far as changes of it need that."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Origin:
    """Not part of a scenario: two from different files may be equal, so all origins are."""

    source: str = field(compare=False)
    """The file, in messages."""
    folder: str = field(compare=False)
    """Where modules of one's own are looked for first; "" for the current one."""
    data: Mapping[str, Any] = field(compare=False)
    """What the file says: no defaults."""
