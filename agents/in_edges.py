"""The edges to a robot at a tick: which in-neighbours it hears, and whether it hears the leader."""

from collections.abc import Iterable

from agents.neighbours import Neighbours
from configs.edges import InEdge, next_change


class InEdges:
    """Follows the edges of one robot through the ticks, in their order.

    At a tick that changes nothing this is one comparison: edges change seldom.
    """

    __slots__ = ("_by_speaker", "_link", "_neighbours", "_next_change", "h", "heard")

    def __init__(
        self, hears: Iterable[InEdge], leader_link: InEdge | None, neighbours: Neighbours
    ) -> None:
        self._neighbours = neighbours
        self._by_speaker = {edge.speaker: edge for edge in hears}
        self._link = leader_link
        self.heard: tuple[str, ...] = ()
        """The in-neighbours at the tick, in the order of names."""
        self.h = 0.0
        """h_i at the tick."""
        self._change(0)

    def follow(self, tick: int) -> tuple[str, ...]:
        """Take the edges of a tick; a neighbour whose edge is gone leaves the sums."""
        if tick >= self._next_change:
            self._change(tick)
        return self.heard

    def _change(self, tick: int) -> None:
        edges, link = self._by_speaker.values(), self._link
        self.heard = tuple(edge.speaker for edge in edges if edge.exists(tick))
        self._neighbours.follow(self.heard)
        self.h = link.weight if link is not None and link.exists(tick) else 0.0
        links = () if link is None else (link,)
        self._next_change = next_change((*edges, *links), tick)

    def exists(self, speaker: str, tick: int) -> bool:
        """Whether the edge from an in-neighbour exists at any tick."""
        return self._by_speaker[speaker].exists(tick)
