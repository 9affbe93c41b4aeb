"""A bus's port of which the test is all clients."""

from collections.abc import Sequence
from typing import NamedTuple

from bridge.can_bus.packet import Key, Submitted, Transmitted
from bridge.frame import Frame
from plant.bus.port import Port, Steps


class Question(NamedTuple):
    """What clients were given at a question, and who has to answer."""

    stamp_ns: int
    frames: Sequence[Frame]
    transmitted: Sequence[Transmitted]
    asked: str | None
    freed: Sequence[tuple[Key, int]]


class ManualPort(Port):
    """Keeps what the bus gives; gives what the test puts into `frames`, `said` and `gone`."""

    def __init__(self) -> None:
        self.questions: list[Question] = []
        self.frames: list[Frame] = []
        self.said: list[Submitted] = []
        self.gone: list[Key] = []
        self._freed: list[tuple[Key, int]] = []

    def deliver(self, stamp_ns: int, frames: Sequence[Frame]) -> None:
        self.questions.append(Question(stamp_ns, frames, (), "", ()))

    def receive(self) -> list[Frame]:
        frames, self.frames = self.frames, []
        return frames

    def forward(self, stamp_ns: int, ended: Sequence[Transmitted], asked: str | None) -> None:
        freed, self._freed = self._freed, []
        self.questions.append(Question(stamp_ns, (), ended, asked, freed))

    def submitted(self) -> list[Submitted]:
        said, self.said = self.said, []
        return said

    def departed(self) -> list[Key]:
        gone, self.gone = self.gone, []
        return gone

    def return_credit(self, key: Key, count: int) -> None:
        self._freed.append((key, count))

    def next_question(self, steps: Steps) -> Question | None:
        """Resume a bus in lockstep: its next question, None at the end of the tick."""
        return None if next(steps) is None else self.questions[-1]
