"""Parts of briefs by which a process finds the router of its run, and its bus.

Every `can.Bus` of a program imports them, so this module imports nothing that takes time.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from configs.tls import TlsFiles

Settings = tuple[tuple[str, str | int | float | bool], ...]
"""Keyword arguments as sorted pairs, so that a brief stays hashable and immutable."""
OURS = "fleetloop"
"""The python-can interface of the buses that the plant's process holds."""
LEASE_S = 1.0
"""A peer on another machine that is silent for this long is gone."""
LOCAL_LEASE_S = 3600.0
"""On one machine a peer that is gone closes its connection; one that is silent is stopped, and may
go on (Ctrl-Z and `fg`)."""


@dataclass(frozen=True, slots=True)
class NetworkLink:
    """Address of the router, and the identity of one process at it."""

    run: str  # the run's name in every key: fleetloop/<run>/...
    endpoint: str  # e.g. tcp/127.0.0.1:40001
    user: str
    password: str = field(repr=False)
    tls: "TlsFiles | None" = None
    lease_s: float = LEASE_S  # the router waits so long for a word of it
    rejoin_s: float = 0.0  # so long the launcher, or the way to it, may be gone


@dataclass(frozen=True, slots=True)
class Outside:
    """Where the router listens for roles on other machines."""

    endpoint: str
    tls: "TlsFiles | None"
