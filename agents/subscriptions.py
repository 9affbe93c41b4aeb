"""The subscriptions of one robot to its in-neighbours' path states, as its edges come and go.

In real time a subscription is declared while its edge exists, and at no other time. In lockstep it
is kept until the edge's last window ends: the first path state after a gap is due at an exact tick,
which a declaration that is under way could miss; what comes in the gap is discarded by the agent.
"""

from bridge.network import keys
from bridge.network.link import Link
from configs.brief import AgentBrief
from configs.edges import InEdge, next_change


class Subscriptions:
    """Declares and undeclares on one link; the tick's work is one comparison."""

    def __init__(self, link: Link, brief: AgentBrief) -> None:
        self._link = link
        self._run = brief.network.run
        self._realtime = brief.schedule.realtime
        self._edges = brief.hears
        self._declared: set[str] = set()
        self.next_change = 0
        """The tick at which `change` is due."""
        self.change(0)

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
        return edge.exists(tick) if self._realtime else not edge.is_over(tick)
