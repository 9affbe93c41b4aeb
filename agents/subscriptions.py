"""The subscriptions of one robot to its in-neighbours' path states, as its edges come and go.

In real time a subscription is declared while its edge exists, and at no other time; that of an
emulated edge with a range while the robots are near enough. A declaration takes its time, and
distances are measured with noise, so the limits are beyond the range, where all is lost anyway:

    declared     until the robots are `LEAVES` ranges apart
    undeclared   until they are `RETURNS` ranges apart

In lockstep it is kept until the edge's last window ends, whatever the range: the first path state
after a gap is due at an exact tick, which a declaration that is under way could miss. What comes in
the gap is discarded by the agent, or lost on the emulated edge.
"""

from collections.abc import Mapping
from typing import Final

from bridge.network import keys
from bridge.network.link import Link
from configs.brief import AgentBrief
from configs.edges import InEdge, next_change

LEAVES: Final = 1.1
RETURNS: Final = 1.05


class Subscriptions:
    """Declares and undeclares on one link; the tick's work is a few comparisons."""

    def __init__(self, link: Link, brief: AgentBrief) -> None:
        self._link = link
        self._run = brief.network.run
        self._realtime = brief.schedule.realtime
        self._edges = brief.hears
        self._ranges_m = {
            model.source: model.distance.range_m
            for model in brief.channels
            if model.distance is not None and self._realtime
        }
        self._far: set[str] = set()  # out of range
        self._declared: set[str] = set()
        self.next_change = 0
        """The tick at which `change` is due."""
        self.change(0)

    def follow(self, tick: int, distances_m: Mapping[str, float]) -> None:
        """Declare and undeclare by the edges from a tick on and the distances to speakers [m]."""
        moved = False
        for speaker, range_m in self._ranges_m.items():
            ranges = distances_m[speaker] / range_m
            if ranges < RETURNS if speaker in self._far else ranges >= LEAVES:
                self._far ^= {speaker}
                moved = True
        if moved or tick >= self.next_change:
            self.change(tick)

    def change(self, tick: int) -> None:
        """Declare what is wanted from a tick on, undeclare what isn't any more."""
        for edge in self._edges:
            wanted, speaker = self._wants(edge, tick), edge.speaker
            if wanted and speaker not in self._declared:
                self._link.subscribe(keys.path(self._run, speaker), f"path/{speaker}")
                self._declared.add(speaker)
            elif not wanted and speaker in self._declared:
                self._link.unsubscribe(keys.path(self._run, speaker))
                self._declared.remove(speaker)
        self.next_change = next_change(self._edges, tick)

    def _wants(self, edge: InEdge, tick: int) -> bool:
        if self._realtime:
            return edge.exists(tick) and edge.speaker not in self._far
        return not edge.is_over(tick)
