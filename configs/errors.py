"""What a user can cause: one line, and the exit status that the process ends with.

Exit statuses of every command: 0 held, 1 an expectation failed (or a difference was found, or a
record isn't all there), 2 usage or scenario, 3 infrastructure, 130 interrupted. Anything else is a
bug and keeps its traceback.
"""

from collections.abc import Sequence
from typing import NamedTuple


class Complaint(NamedTuple):
    """One thing wrong with a file or an option."""

    where: str  # the file, or the option as it was given
    key: str  # as in the file, robots by name; "" if it is about all of it
    value: object
    right: str  # what would be right


class FleetloopError(Exception):
    """An error that a user can cause or mend; its text is the whole message."""

    exit_code = 3


class ScenarioError(FleetloopError):
    """A file or an option says something that can't be run; nothing was started."""

    exit_code = 2

    def __init__(self, text: str, complaints: Sequence[Complaint] = ()) -> None:
        super().__init__(text)
        self.complaints = tuple(complaints)
        """The same for machines; empty if it is one sentence."""


class InfrastructureError(FleetloopError):
    """The machine, a process, a bus or a network failed; the text names which and when."""

    exit_code = 3


class PeerSilentError(InfrastructureError):
    """Another process did not say what was due; the text names it."""


class PeerLostError(InfrastructureError):
    """Another process went away; it is the cause, this is only how it was noticed."""
