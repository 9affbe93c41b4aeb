"""Faults of the messages to one robot: its emulated edges lose and delay more than by themselves.

As in `plant.faults`, an edge's faults are made anew of all that act when one begins or ends.
"""

from collections.abc import Callable
from typing import Any

from bridge.fault_schedule import FaultSchedule
from bridge.netem.channel import Channel
from bridge.network.fault_orders import FaultOrder
from configs.brief import AgentBrief
from configs.edges import LEADER, edge_text, parse_edge
from configs.faults.base import PlannedFault
from configs.faults.messages import LinkDelay, LinkLoss, LinkPartition, PoseOutage
from configs.netem import LOCALISATION

Channels = Callable[[str, int], Channel[Any]]
"""The channel of a source, made at a tick if there is none."""


class MessageFaults:
    """The faults of the messages to one robot.

    Args:
        brief: of its controller.
        channel_of: its emulated edges.
        note: called with the tick, kind and text of the event of each that begins or ends.
    """

    __slots__ = ("_channel_of", "_note", "_period_s", "_schedules", "schedule")

    def __init__(
        self, brief: AgentBrief, channel_of: Channels, note: Callable[[int, str, str], None]
    ) -> None:
        self.schedule = FaultSchedule(one for one in brief.faults if one.fault.PLACE == "agent")
        self._channel_of = channel_of
        self._note = note
        self._period_s = brief.schedule.period_s
        sources = [LOCALISATION, *(edge.speaker for edge in brief.hears)]
        sources += [LEADER] if brief.leader_link is not None else []
        edges = (edge_text((source, brief.robot)) for source in sources)
        self._schedules = dict.fromkeys((brief.robot, *edges), self.schedule)

    def take(self, order: FaultOrder, tick: int | str) -> int | str:
        """Take an order that acts at a tick; return it, or why it can't act."""
        return order.act(self._schedules, tick, self._period_s) if isinstance(tick, int) else tick

    def begin(self, tick: int) -> None:
        """Let the faults of a tick act, before the messages of the tick are sent and received."""
        if tick >= self.schedule.next_tick:
            self._change(tick)

    def _change(self, tick: int) -> None:
        changes = self.schedule.due(tick)
        for change in changes:
            self._note(tick, change.event.kind, change.event.text)
        for source in dict.fromkeys(_source(change.planned) for change in changes):
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
            self._channel_of(source, tick).disturb(delay_s, 1.0 - arrives, cut=cut)


def _source(planned: PlannedFault) -> str:
    edge = parse_edge(planned.target)
    return LOCALISATION if edge is None else edge[0]
