"""A job as the process that does it gets it, and what it says meanwhile.

A scenario travels as text: a process loads it, and its laws, as `fleetloop run` does. What loads
scenarios is imported by who does: it takes most of a second.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from bridge.process.lifecycle import Stop

if TYPE_CHECKING:
    from configs.scenario import Scenario

Tell = Callable[[object], None]
"""Says that a job goes on: a `Progress`, or part of the result."""


class Job(Protocol):
    """Work for one process; it travels there as a pickle."""

    def work(self, tell: Tell, stop: Stop) -> object:
        """Do it; the result is None only if it was told to stop."""


@dataclass(frozen=True, slots=True)
class Brief:
    """A job, and the descriptor on which its process tells of it."""

    job: Job
    tell_fd: int


@dataclass(frozen=True, slots=True)
class Done:
    """The last thing that a job's process says."""

    result: object


@dataclass(frozen=True, slots=True)
class Told:
    """A scenario on its way to another process."""

    toml: str
    folder: str

    @classmethod
    def of(cls, scenario: "Scenario", folder: str) -> "Told":
        """Of a scenario whose own laws and shapes are in this folder."""
        from configs.loading import to_toml

        return cls(to_toml(scenario), folder)

    def scenario(self) -> "Scenario":
        """The scenario again."""
        from configs.loading import loads
        from fleetloop.results import run_folder

        return loads(run_folder.SCENARIO, self.toml, folder=self.folder)
