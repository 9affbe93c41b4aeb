"""Faults of the messages to one robot: its emulated edges lose and delay more than by themselves.

As in `plant.faults`, an edge's faults are made anew of all that act when one begins or ends.
"""

from collections.abc import Iterable

from agents.emulated_network import EmulatedNetwork
from bridge.fault_schedule import FaultSchedule
from configs.edges import parse_edge
from configs.faults.base import PlannedFault
from configs.faults.messages import LinkDelay, LinkLoss, LinkPartition, PoseOutage
from configs.netem import LOCALISATION


class MessageFaults:
    """The faults of the messages to one robot."""

    __slots__ = ("_network", "schedule")

    def __init__(self, planned: Iterable[PlannedFault], network: EmulatedNetwork | None) -> None:
        of_messages = (one for one in planned if one.fault.PLACE == "agent")
        self.schedule = FaultSchedule(of_messages if network is not None else ())
        self._network = network

    def begin(self, tick: int) -> None:
        """Let the faults of a tick act, before the messages of the tick are sent and received."""
        if tick >= self.schedule.next_tick and self._network is not None:
            self._change(tick, self._network)

    def _change(self, tick: int, network: EmulatedNetwork) -> None:
        for source in dict.fromkeys(_source(change.planned) for change in self.schedule.due(tick)):
            delay_s, arrives, cut = 0.0, 1.0, False
            for planned in self.schedule.acting:
                if _source(planned) != source:
                    continue
                match planned.fault:
                    case LinkDelay(delay_s=more_s):
                        delay_s += more_s
                    case LinkLoss(probability=probability):
                        arrives *= 1.0 - probability
                    case LinkPartition() | PoseOutage():
                        cut = True
            network.channel(source).disturb(delay_s, 1.0 - arrives, cut=cut)


def _source(planned: PlannedFault) -> str:
    edge = parse_edge(planned.target)
    return LOCALISATION if edge is None else edge[0]
