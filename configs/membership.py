"""When a robot is part of the formation: it may join late, and leave.

Before it joins a robot listens: edges to it exist, edges from it don't. Once it has left there are
neither.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from configs.edges import FOREVER, LEADER, Edge, Windows


@dataclass(frozen=True, slots=True)
class Membership:
    """The ticks at which a robot is part of the formation."""

    joins_tick: int = 0  # the first of them
    leaves_tick: int = FOREVER  # the first after them

    @property
    def ticks(self) -> slice:
        """Of the rows of the robot."""
        return slice(self.joins_tick, self.leaves_tick)

    def overlaps(self, first: float, last: float) -> bool:
        """Whether it is a member at a tick from `first` to `last`, these included."""
        return self.joins_tick <= last + 1e-6 and self.leaves_tick > first - 1e-6

    def __contains__(self, tick: int) -> bool:
        return self.joins_tick <= tick < self.leaves_tick


ALWAYS = Membership()


def windows_of(edge: Edge, windows: Windows | None, members: dict[str, Membership]) -> Windows:
    """The windows of an edge while its speaker is a member and its hearer hasn't left."""
    speaker, hearer = edge
    says = ALWAYS if speaker == LEADER else members[speaker]
    first, last = says.joins_tick, min(says.leaves_tick, members[hearer].leaves_tick)
    cut = ((max(a, first), min(b, last)) for a, b in windows or ((0, FOREVER),))
    return tuple((a, b) for a, b in cut if a < b)


def attended(
    windows: dict[Edge, Windows | None], members: dict[str, Membership]
) -> dict[Edge, Windows | None]:
    """The windows of all edges that exist at some time, by who is there."""
    if all(member == ALWAYS for member in members.values()):
        return windows
    cut = {edge: windows_of(edge, each, members) for edge, each in windows.items()}
    always = ((0, FOREVER),)
    return {edge: None if each == always else each for edge, each in cut.items() if each}


def changes(members: Iterable[Membership]) -> list[int]:
    """Ticks at which a robot joins or leaves, and 0, in order."""
    ticks = {0}
    for member in members:
        ticks |= {member.joins_tick, member.leaves_tick}
    return sorted(ticks - {FOREVER})
