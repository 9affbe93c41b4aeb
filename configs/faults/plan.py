"""The faults of a scenario by target and tick, and what relates them to its other sections."""

from collections.abc import Collection, Iterator, Sequence
from math import ceil
from typing import TYPE_CHECKING

from configs.edge_checks import robot_problems
from configs.emulated_edges import EmulatedEdge, edges_of, named, pattern_problem
from configs.errors import Problem
from configs.faults.absences import absences, overlapping
from configs.faults.base import Fault, PlannedFault, RobotFault
from configs.faults.messages import LinkFault, PoseOutage
from configs.faults.processes import ProcessRestart, ProcessStopped
from configs.faults.sense import sense_problems
from configs.netem import LOCALISATION

if TYPE_CHECKING:
    from configs.scenario import Scenario


def fresh_name(kind: str, names: Collection[str]) -> str:
    """The name of a fault without one: its kind, with a number from the second one on."""
    number, name = 1, kind
    while name in names:
        number += 1
        name = f"{kind}_{number}"
    return name


def names_of(faults: Sequence[Fault]) -> list[str]:
    """The name of each fault: its own, else a fresh one."""
    taken = {fault.name for fault in faults if fault.name is not None}
    names = []
    for fault in faults:
        name = fault.name or fresh_name(fault.kind, taken)
        taken.add(name)
        names.append(name)
    return names


def targets_of(fault: Fault, scenario: "Scenario") -> list[str]:
    """What a fault acts on: robots, or edges of links."""
    if isinstance(fault, LinkFault):
        return [str(edge) for edge in _edges_of(fault, scenario)]
    if isinstance(fault, RobotFault) and fault.robots is not None:
        return list(fault.robots)
    return list(scenario.names)


def plan(fault: Fault, name: str, scenario: "Scenario") -> list[PlannedFault]:
    """A fault as it acts on each of its targets."""
    first, last = _ticks_of(fault, scenario)
    return [
        PlannedFault(name, target, fault, first, last) for target in targets_of(fault, scenario)
    ]


def _ticks_of(fault: Fault, scenario: "Scenario") -> tuple[int, int | None]:
    """The first tick at which a fault acts, and the first at which it doesn't any more."""
    first = _first_tick(fault.at_s, scenario)
    return first, None if fault.for_s is None else _first_tick(fault.at_s + fault.for_s, scenario)


def _first_tick(t_s: float, scenario: "Scenario") -> int:
    """The first tick at or after a time."""
    return ceil(t_s / scenario.clock.control_period_s - 1e-6)


def planned_faults(scenario: "Scenario") -> list[PlannedFault]:
    """All faults of a scenario, in its order."""
    names = names_of(scenario.fault)
    return [
        planned
        for fault, name in zip(scenario.fault, names, strict=True)
        for planned in plan(fault, name, scenario)
    ]


def fault_window(scenario: "Scenario", name: str) -> tuple[float, float | None] | None:
    """(from_s, to_s) of the fault of a name; to_s None: to the end; None: there is no such fault.

    A fault that is an instant begins and ends at once.
    """
    for fault, of in zip(scenario.fault, names_of(scenario.fault), strict=True):
        if of == name:
            if fault.INSTANT:
                return fault.at_s, fault.at_s
            return fault.at_s, None if fault.for_s is None else fault.at_s + fault.for_s
    return None


def faulted_sources(scenario: "Scenario", hearer: str) -> set[str]:
    """Sources of the messages to a robot that some fault of links concerns."""
    return {
        edge.source
        for fault in scenario.fault
        for edge in _edges_of(fault, scenario)
        if edge.hearer == hearer
    }


def _edges_of(fault: Fault, scenario: "Scenario") -> list[EmulatedEdge]:
    """The edges on which messages are lost or late."""
    if isinstance(fault, PoseOutage):
        robots = scenario.names if fault.robots is None else fault.robots
        return [EmulatedEdge(LOCALISATION, robot) for robot in robots]
    if not isinstance(fault, LinkFault):
        return []
    edges = edges_of(scenario.topology)
    return [edge for edge in edges if any(named(text, edge) for text in fault.edges)]


def fault_problems(scenario: "Scenario", *, sound_edges: bool) -> Iterator[Problem]:
    """Faults that can't act, and names that mean two."""
    seen: set[str] = set()
    for n, fault in enumerate(scenario.fault):
        if fault.name is not None and fault.name in seen:
            yield Problem(f"fault.{n}.name", fault.name, "another fault has this name")
        seen |= set() if fault.name is None else {fault.name}
        yield from problems_of(fault, f"fault.{n}", scenario, sound_edges=sound_edges)
    of_processes = (one for one in scenario.fault if one.PLACE == "process")
    stopped = absences(one for fault in of_processes for one in plan(fault, "", scenario))
    if (overlap := overlapping(stopped)) is not None:
        period_s = scenario.clock.control_period_s
        at_s = overlap.after.from_tick * period_s
        yield Problem("fault.at_s", at_s, overlap.problem(period_s))


def problems_of(
    fault: Fault, where: str, scenario: "Scenario", *, sound_edges: bool = True
) -> Iterator[Problem]:
    """Why one fault can't act in this scenario."""
    if isinstance(fault, RobotFault):
        yield from robot_problems(scenario.names, f"{where}.robots", fault.robots or ())
    if isinstance(fault, LinkFault) and sound_edges:
        edges = edges_of(scenario.topology)
        for text in fault.edges:
            if problem := pattern_problem(text, edges, scenario.names):
                yield Problem(f"{where}.edges", text, problem)
    end_s = max(scenario.duration_s, scenario.ends_at_s)
    first, last = _ticks_of(fault, scenario)
    if first >= _first_tick(end_s, scenario):
        remedy = f"the run ends before: must be below duration_s = {end_s:g}"
        yield Problem(f"{where}.at_s", fault.at_s, remedy)
    if last == first:
        period_s = scenario.clock.control_period_s
        remedy = f"no tick from {fault.at_s:g} s on for so long: they are {period_s:g} s apart"
        yield Problem(f"{where}.for_s", fault.for_s, remedy)
    if reason := _missing_model(fault, scenario) or no_return(fault, scenario):
        yield Problem(f"{where}.kind", fault.kind, reason)
    yield from sense_problems(fault, where, scenario)


def no_return(fault: Fault, scenario: "Scenario") -> str | None:
    """Why a process that is to be there again can't be, and what lets it."""
    stays_away = isinstance(fault, ProcessStopped) and fault.for_s is None
    if not isinstance(fault, ProcessStopped | ProcessRestart) or stays_away:
        return None
    lockstep, policy = scenario.clock.mode == "lockstep", scenario.clock.on_late
    if lockstep and policy == "abort":
        return "ends a lockstep run: needs clock.on_late = 'hold' or 'drop', or real time"
    keeps_its_state = fault.kind == "process_freeze" and not (lockstep and policy == "drop")
    if scenario.localisation.source == "odometry" and not keeps_its_state:
        return "odometry alone doesn't know where the robot is after a start: needs fixes"
    return None


def process_fault_problem(scenario: "Scenario") -> str | None:
    """Why the scenario can't run in one process; None if no fault keeps it from that."""
    kinds = dict.fromkeys(one.kind for one in scenario.fault if one.PLACE == "process")
    if not kinds:
        return None
    return f"{', '.join(kinds)} can't act in one process: the run over processes has it"


def _missing_model(fault: Fault, scenario: "Scenario") -> str | None:
    """What the scenario doesn't emulate and the fault needs, and how to have it."""
    if "powertrain" in fault.NEEDS and scenario.drive.preset != "realistic":
        preset = scenario.drive.preset
        return f"can't act on drives of preset {preset!r}: needs drive.preset = 'realistic'"
    if "wire" in fault.NEEDS and scenario.bus.timing != "wire":
        return f"can't act on a bus with {scenario.bus.timing} timing: needs bus.timing = 'wire'"
    return None
