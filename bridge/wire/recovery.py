"""The way back from bus-off: 128 sequences of 11 recessive bits (ISO 11898-1).

    idle wire       every 11 bits are a sequence
    end of a frame  is one: delimiter, end of frame, intermission; of an error frame as well
    any frame       ends a sequence that isn't complete

So on an idle wire a node is back after 1408 bits, on a full one after 128 frames.
"""

from bridge.wire.confinement import RECESSIVE_BITS, RECOVERY_SEQUENCES
from bridge.wire.node import Node

_SECOND_NS = 1_000_000_000


class Recovery:
    """The nodes of a segment that are on their way back."""

    __slots__ = ("_bit_rate", "nodes")

    def __init__(self, bit_rate: int) -> None:
        self._bit_rate = bit_rate
        self.nodes: list[Node] = []

    def start(self, node: Node, from_ns: int) -> None:
        """Let a node count from this instant on."""
        node.sequences_left = RECOVERY_SEQUENCES
        node.recessive_from_ns = from_ns
        if node not in self.nodes:
            self.nodes.append(node)

    def back_ns(self, node: Node) -> int:
        """When a node is back if the wire stays idle."""
        return node.recessive_from_ns + self._span(node.sequences_left * RECESSIVE_BITS)

    def next(self, before_ns: int | None) -> Node | None:
        """The node that is back first, if that is before the next frame begins."""
        if not self.nodes:
            return None
        node = min(self.nodes, key=self.back_ns)
        return node if before_ns is None or self.back_ns(node) <= before_ns else None

    def finish(self, node: Node) -> int:
        """A node is back; return when."""
        at_ns = self.back_ns(node)
        self.nodes.remove(node)
        node.sequences_left = 0
        node.confinement.restart()
        return at_ns

    def count(self, start_ns: int, free_ns: int) -> None:
        """A transmission has passed: count what was recessive before it, and begin in its end."""
        span = self._span(RECESSIVE_BITS)
        for node in self.nodes:
            node.sequences_left -= max(0, start_ns - node.recessive_from_ns) // span
            node.recessive_from_ns = max(node.recessive_from_ns, free_ns - span)

    def _span(self, bits: int) -> int:
        return bits * _SECOND_NS // self._bit_rate
