"""Findings about robots that join late or leave: what Theorem 3.1 asks of those that are there.

Between two changes of the formation the graph of its members, of all edges that exist meanwhile,
has to meet both conditions: the leader reaches every member, and one member reaches all others.
"""

from collections.abc import Iterator
from itertools import pairwise

from configs.edges import InEdge
from configs.graph import Graph
from configs.membership import ALWAYS, changes
from configs.scenario import Scenario
from fleetloop.check.finding import Finding

_TITLE, _BASIS = "members of the formation", "Theorem 3.1, of those that are there"


def membership_findings(scenario: Scenario) -> Iterator[Finding]:
    """Nothing where all robots are members from the start to the end."""
    members, period_s = scenario.members, scenario.clock.control_period_s
    if all(member == ALWAYS for member in members.values()):
        return
    end = round(max(scenario.duration_s, scenario.ends_at_s) / period_s)
    ticks = [tick for tick in changes(members.values()) if tick < end]
    sound = True
    for first, last in pairwise([*ticks, end]):
        there = [robot for robot, member in members.items() if first in member]
        absent = [robot for robot in members if robot not in there]
        trouble = _trouble(scenario.topology, there, first, last)
        if trouble:
            sound = False
            when = f"from {first * period_s:g} s to {last * period_s:g} s, without"
            text = f"{when} {', '.join(absent)}: {trouble}"
            yield Finding("warning", _TITLE, text, key=_key(scenario, absent), basis=_BASIS)
    if sound:
        said = "at all times the leader reaches every member, and their graph is rooted"
        yield Finding("ok", _TITLE, said, basis=_BASIS)


def _trouble(graph: Graph, there: list[str], first: int, last: int) -> str:
    """The condition that these robots don't meet, "" if they meet both."""
    if not there:
        return "nobody is there"

    def exists(edge: InEdge) -> bool:
        return edge.exists(first) or edge.next_change(first) < last

    edges = [
        (edge.speaker, robot)
        for robot in there
        for edge in graph.hears[robot]
        if edge.speaker in there and exists(edge)
    ]
    leader = [robot for robot in there if robot in graph.links and exists(graph.links[robot])]
    part = Graph.of(there, edges, leader)
    unreached = part.unreached_from(leader)
    if unreached:
        return f"the leader doesn't reach {', '.join(unreached)}, whose v̂_r stays as it is"
    if not part.roots():
        return "no robot reaches all others, so s_i − s_j doesn't vanish"
    return ""


def _key(scenario: Scenario, absent: list[str]) -> str:
    """The key of the first absent robot that makes it absent."""
    robot = next(robot for robot in scenario.robot if robot.name in absent)
    late = scenario.members[robot.name].joins_tick > 0
    return f"robot.{robot.name}.{'joins_at_s' if late else 'leaves_at_s'}"
