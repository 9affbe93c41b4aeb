"""What a run costs the plant."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(slots=True)
class PlantCounters:
    """The cost of the run, for the summary."""

    ticks: int = 0
    wall_ns: int = 0
    waited_ns: int = 0
    overruns: int = 0
    frames: dict[str, int] = field(default_factory=dict)
    nodes: dict[str, dict[str, int]] = field(default_factory=dict)  # of wires, by bus/node

    def add_nodes(self, bus: str, counts: Mapping[str, dict[str, int]]) -> None:
        """Add the nodes of a bus."""
        self.nodes |= {f"{bus}/{node}": of_node for node, of_node in counts.items()}
