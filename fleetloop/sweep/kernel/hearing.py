"""Which path state of each neighbour counts at each tick, by the emulated network and the graph.

That depends on the schedule, the random numbers and the switching alone, not on what is said: path
states are due at every share. So it is known beforehand, by the very parts that decide it in a
controller: an edge's `Channel`, its `InEdges` and its `Neighbours` are run from event to event, and
a message is the number of its share. What the loop needs is a list of changes: from this tick on
that share counts, or none.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from agents.in_edges import InEdges
from agents.neighbours import Neighbours
from bridge.netem.channel import Channel
from configs.brief import ChannelModel, Schedule
from configs.edges import FOREVER, InEdge
from configs.sections import Coordination

NONE: Final = -1
"""No share counts: nothing was heard since the edge exists."""
Changes = list[tuple[int, int]]
"""From a tick on, the number of the share that counts, or `NONE`."""


def changes_of(
    edge: InEdge, model: ChannelModel | None, schedule: Schedule, coordination: Coordination
) -> Changes:
    """The changes of one edge between robots; `model`: of its channel, None if it has none."""
    neighbours = Neighbours((edge,), coordination, schedule.period_s)
    in_edges = InEdges((edge,), None, neighbours)
    channel: Channel[int] | None = None
    if model is not None:
        channel = Channel(model, model.seed, round(coordination.age_limit_s * 1e9))
    period_ns, every = schedule.period_ns, schedule.share_every
    changes: Changes = []
    newest, tick = NONE, 0
    while tick < schedule.ticks:
        now_ns = tick * period_ns
        exists = bool(in_edges.follow(tick))
        if tick % every == 0 and exists:
            if channel is None:
                neighbours.receive(edge.speaker, now_ns, 0.0, 0.0)
            else:
                channel.send(now_ns, tick)
        due_tick = FOREVER
        if channel is not None:
            for _, said_tick in channel.receive(now_ns, exists=exists):
                neighbours.receive(edge.speaker, said_tick * period_ns, 0.0, 0.0)
            if channel.next_due_ns is not None:
                due_tick = -(-channel.next_due_ns // period_ns)
        (age_s,) = neighbours.ages_s(now_ns)
        counts = NONE if age_s != age_s else (tick - round(age_s / schedule.period_s)) // every
        if counts != newest:
            newest = counts
            changes.append((tick, counts))
        tick = min(due_tick, edge.next_change(tick), (tick // every + 1) * every)
    return changes


def ages_s(changes: Changes | None, schedule: Schedule) -> NDArray[np.float64]:
    """The age of what counts, at every tick; None: the newest share always counts. NaN: none."""
    ticks = np.arange(schedule.ticks)
    counts = ticks // schedule.share_every
    if changes is not None:
        counts[:] = NONE
        for tick, share in changes:
            counts[tick:] = share
    said_ns = counts * schedule.share_every * schedule.period_ns
    ages = (ticks * schedule.period_ns - said_ns) * 1e-9
    return np.where(counts < 0, np.nan, ages).astype(np.float64)


def link_changes(link: InEdge, ticks: int) -> Changes:
    """When a leader link exists: 1, or 0."""
    changes = [(0, int(link.exists(0)))]
    tick = link.next_change(0)
    while tick < ticks:
        changes.append((tick, int(link.exists(tick))))
        tick = link.next_change(tick)
    return changes
