"""Errors that a user can cause: one line each, and the exit status of the process.

Any other exception is a bug and keeps its traceback.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple


class ExitStatus(IntEnum):
    """Exit status of every command and of every role's process."""

    OK = 0
    """What was asked for is done, and held."""
    FAILED = 1
    """An expectation failed or was not reached, runs differ, or a record isn't all there."""
    USAGE = 2
    """An option, a scenario or a deployment is wrong; nothing was started."""
    INFRASTRUCTURE = 3
    """The machine, a process, a bus or a network failed."""
    NOTHING = 5
    """Nothing to do: of `fleetloop test`, no scenario."""
    INTERRUPTED = 130
    """Ended by a signal, as a shell counts Ctrl-C."""


class Complaint(NamedTuple):
    """One thing wrong with a file or an option."""

    where: str  # the file, or the option as it was given
    key: str  # as in the file, robots by name; "" if it is about all of it
    value: object
    remedy: str  # the values that are allowed, or what to change


class Problem(NamedTuple):
    """One thing wrong with a scenario."""

    key: str  # as in the file, robots by name
    value: object
    remedy: str  # the values that are allowed, or what to change


class KeyValueError(ValueError):
    """The value of a key is wrong beside those of the other keys of its table.

    Args:
        key: of the table; entries of a list by number, as `"delays_s.3"`.
        remedy: the values that are allowed, or what to change.
    """

    def __init__(self, key: str, remedy: str) -> None:
        super().__init__(f"{key}: {remedy}")
        self.key = key
        self.remedy = remedy


class FleetloopError(Exception):
    """An error that a user can cause or mend; its text is the whole message."""

    exit_status = ExitStatus.INFRASTRUCTURE


class ScenarioError(FleetloopError):
    """A file or an option says something that can't be run; nothing was started."""

    exit_status = ExitStatus.USAGE

    def __init__(self, text: str, complaints: Sequence[Complaint] = ()) -> None:
        super().__init__(text)
        self.complaints = tuple(complaints)
        """The same for machines; empty if it is one sentence."""


class InfrastructureError(FleetloopError):
    """The machine, a process, a bus or a network failed; the text names which and when."""

    exit_status = ExitStatus.INFRASTRUCTURE


class PeerSilentError(InfrastructureError):
    """A message of another process that was due did not come; the text names both."""


class PeerLostError(InfrastructureError):
    """Another process ended, which is the cause; this error is how it was noticed."""
