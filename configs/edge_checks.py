"""Problems of one edge, of one link, of one time: shared by all that names them."""

from collections.abc import Iterator, Sequence

from configs.edges import LEADER, parse_edge
from configs.errors import Problem


def no_such_robot(names: Sequence[str]) -> str:
    """The remedy of a name that no robot has."""
    return f"no such robot; known: {', '.join(dict.fromkeys(names))}"


def robot_problems(names: Sequence[str], key: str, robots: Sequence[str]) -> Iterator[Problem]:
    """Problems of a list of robots: one that isn't there, one that is named twice."""
    for n, robot in enumerate(robots):
        if robot not in names:
            yield Problem(key, robot, no_such_robot(names))
        elif robot in robots[:n]:
            yield Problem(key, robot, "is named twice")


def edge_problem(
    names: Sequence[str], key: str, text: str, *, links: bool = False
) -> Iterator[Problem]:
    """Problems of an edge; with `links` it may be one from the leader."""
    edge = parse_edge(text)
    if edge is None:
        yield Problem(key, text, 'must read "r1 -> r2": r2 hears r1')
        return
    speakers = (*names, LEADER) if links else names
    for robot, known in zip(edge, (speakers, names), strict=True):
        if robot not in known:
            yield Problem(key, text, f"{robot}: {no_such_robot(known)}")
    if edge[0] == edge[1]:
        yield Problem(key, text, "a robot doesn't hear itself")


def multiple_problem(
    key: str, value: float, period_s: float, *, least: int = 1
) -> Iterator[Problem]:
    """The problem of a time that isn't a whole multiple of the control period."""
    ratio = value / period_s
    if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < least:
        below = max(int(ratio), 1) * period_s
        yield Problem(
            key,
            value,
            f"must be a whole multiple of clock.control_period_s = {period_s:g}"
            f", for example {below:g}",
        )
