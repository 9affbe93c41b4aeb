"""Problems of [[graph.switch]]: its keys, times and edges, and how often it switches."""

import itertools
from collections.abc import Iterator

from configs.edge_checks import edge_problem, multiple_problem, robot_problems
from configs.errors import Problem
from configs.graph_section import Switch
from configs.scenario import Scenario
from configs.switching import MOST_WINDOWS, most_windows, names_links, texts_of

_KINDS = ("edges", "generator", "rotate", "random")


def switch_problems(scenario: Scenario) -> Iterator[Problem]:
    """What is wrong with the switches of a scenario, one by one."""
    switches = scenario.graph.switch
    for n, switch in enumerate(switches):
        yield from _keys(f"graph.switch.{n}", switch)
        yield from _times(f"graph.switch.{n}", switch, scenario)
        for key, text in texts_of(switch):
            yield from edge_problem(scenario.names, f"graph.switch.{n}.{key}", text, links=True)
        yield from robot_problems(scenario.names, f"graph.switch.{n}.leader", switch.leader or ())
    starts = [switch.at_s for switch in switches]
    if any(b <= a for a, b in itertools.pairwise(starts)):
        yield Problem("graph.switch", starts, "at_s must increase")


def _keys(where: str, switch: Switch) -> Iterator[Problem]:
    """One kind of switch, with what belongs to it."""
    given = [kind for kind in _KINDS if getattr(switch, kind) not in (None, False)]
    if len(given) != 1:
        yield Problem(where, given, f"give one of {', '.join(_KINDS)}")
        return
    (kind,) = given
    drawn = [key for key in ("probability", "pool") if getattr(switch, key) is not None]
    if kind == "random" and len(drawn) != 1:
        yield Problem(f"{where}.random", True, "give probability or pool: what is drawn")
    if kind != "random" and drawn:
        remedy = f"goes with random = true, not with {kind}"
        yield Problem(f"{where}.{drawn[0]}", getattr(switch, drawn[0]), remedy)
    again = kind in ("rotate", "random")
    if again and switch.dwell_s is None:
        yield Problem(f"{where}.dwell_s", None, f"must be given with {kind}: how long a set exists")
    if not again and switch.dwell_s is not None:
        yield Problem(f"{where}.dwell_s", switch.dwell_s, f"goes with rotate or random, not {kind}")
    if switch.leader is not None and names_links(switch):
        remedy = "its edge sets have leader links; give it those or leader"
        yield Problem(f"{where}.leader", list(switch.leader), remedy)


def _times(where: str, switch: Switch, scenario: Scenario) -> Iterator[Problem]:
    period_s = scenario.clock.control_period_s
    yield from multiple_problem(f"{where}.at_s", switch.at_s, period_s, least=0)
    if switch.dwell_s is not None:
        yield from multiple_problem(f"{where}.dwell_s", switch.dwell_s, period_s)
    end_s = max(scenario.duration_s, scenario.ends_at_s)
    if switch.at_s >= end_s:
        yield Problem(
            f"{where}.at_s",
            switch.at_s,
            f"the run ends before: must be below duration_s = {end_s:g}",
        )


def count_problems(scenario: Scenario) -> Iterator[Problem]:
    """Too many windows, of a scenario whose edges and switches are all right."""
    switches = scenario.graph.switch
    end_s = max(scenario.duration_s, scenario.ends_at_s)
    windows = most_windows(scenario.first_edges, switches, scenario.names, end_s)
    if windows > MOST_WINDOWS:
        yield Problem(
            "graph.switch",
            [switch.dwell_s for switch in switches],
            f"up to {windows:.0f} windows of edges in {end_s:g} s; at most {MOST_WINDOWS}: a longer"
            " dwell_s, or a shorter run",
        )
