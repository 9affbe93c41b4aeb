"""Signs of life of a run's processes, as the launcher receives them.

beats     in real time every process says how far it is, several times a second
frozen    silent for `FROZEN_S`: said once, at once, whatever the run's deadlines make of it
back      the next beat of a frozen process
"""

from dataclasses import dataclass
from typing import NamedTuple

from bridge.network.messages import PROGRESS_EVERY_S

FROZEN_S = 3.0 * PROGRESS_EVERY_S
"""Three beats of the slowest to beat."""


@dataclass(slots=True)
class _Vital:
    tick: int
    at_s: float
    frozen: bool = False
    ended: bool = False


class Silence(NamedTuple):
    """Somebody's."""

    process: str
    tick: int  # the last that was heard of
    lasted_s: float


class Vitals:
    """Told of every beat; times are of one clock, that stands still when the listener does [s]."""

    def __init__(self) -> None:
        self._vitals: dict[str, _Vital] = {}

    def beat(self, process: str, tick: int, now_s: float) -> Silence | None:
        """A process says how far it is; return the silence that ends with it, if it was frozen."""
        before = self._vitals.get(process)
        self._vitals[process] = _Vital(tick, now_s)
        if before is None or not before.frozen:
            return None
        return Silence(process, before.tick, now_s - before.at_s)

    def tick(self, process: str) -> int | None:
        """The tick of the last beat of a process; None before its first."""
        vital = self._vitals.get(process)
        return None if vital is None else vital.tick

    def end(self, process: str) -> None:
        """A process said its last word: it doesn't freeze any more."""
        if (vital := self._vitals.get(process)) is not None:
            vital.ended = True

    def silence(self, process: str, now_s: float) -> Silence | None:
        """Silence of a process; None before its first beat."""
        vital = self._vitals.get(process)
        return None if vital is None else Silence(process, vital.tick, now_s - vital.at_s)

    def newly_frozen(self, now_s: float) -> list[Silence]:
        """Processes that have been silent for too long, each once."""
        found = []
        for process, vital in self._vitals.items():
            if not (vital.frozen or vital.ended) and now_s - vital.at_s > FROZEN_S:
                vital.frozen = True
                found.append(Silence(process, vital.tick, now_s - vital.at_s))
        return found
