"""Faults whose values make no sense in a scenario, or that would change nothing there."""

from collections.abc import Iterator
from math import inf
from typing import TYPE_CHECKING

from configs.errors import Problem
from configs.faults.base import Fault, RobotFault
from configs.faults.bodies import Friction, Payload
from configs.faults.messages import PoseDrift, PoseOffset, PoseOutage
from configs.faults.powertrains import DriveError, DriveFault, OverVoltage, UnderVoltage
from configs.plugins import Recorded, raised

if TYPE_CHECKING:
    from configs.scenario import Scenario
    from configs.sections import Body


def sense_problems(fault: Fault, where: str, scenario: "Scenario") -> Iterator[Problem]:
    """Why the values of one fault make no sense in this scenario."""
    match fault:
        case DriveFault():
            yield from _drives(fault, where, scenario)
        case Payload():
            yield from _loads(fault, where, scenario)
        case Friction():
            yield from _friction(fault, where, scenario)
        case UnderVoltage() | OverVoltage():
            yield from _supply(fault, where, scenario)
        case PoseOffset() | PoseDrift() | PoseOutage():
            if scenario.localisation.source == "odometry":
                remedy = "poses aren't used: localisation.source is 'odometry'"
                yield Problem(f"{where}.kind", fault.kind, remedy)


def _drives(fault: DriveFault, where: str, scenario: "Scenario") -> Iterator[Problem]:
    """What the protocol knows of its emulated drives; its code may be a user's."""
    drive = scenario.drive
    if isinstance(scenario.drive_choice.parameters, Recorded):
        return
    try:
        reason, errors = drive.fault_problem(fault.kind), drive.errors()
    except Exception as error:
        reason, errors = f"its check: {raised(error)}", ()
    if reason:
        yield Problem(f"{where}.kind", fault.kind, reason)
    elif isinstance(fault, DriveError) and fault.error not in (None, *errors):
        known = ", ".join(errors)
        yield Problem(f"{where}.error", fault.error, f"drives have no such error; known: {known}")


def _loads(fault: Payload, where: str, scenario: "Scenario") -> Iterator[Problem]:
    """Masses and inertias stay positive at each time at which loads change while this one acts."""
    for robot, body in _bodies(fault, scenario):
        loads = [
            other
            for other in scenario.fault
            if isinstance(other, Payload) and robot in (other.robots or scenario.names)
        ]
        loads = loads if any(one is fault for one in loads) else [*loads, fault]
        times = {time for one in loads for time in (one.at_s, _end_s(one)) if _acts(fault, time)}
        for key, own, added in (
            ("mass_kg", body.body_mass_kg, fault.mass_kg),
            ("inertia_kg_m2", body.body_inertia_kg_m2, fault.inertia_kg_m2),
        ):
            least = min(
                sum(getattr(one, key) for one in loads if _acts(one, time)) for time in times
            )
            if added < 0.0 and own + least <= 0.0:
                remedy = f"{robot} has {own:g}, of which {-least:g} or more would go: less than it"
                yield Problem(f"{where}.{key}", added, remedy)


def _friction(fault: Friction, where: str, scenario: "Scenario") -> Iterator[Problem]:
    for robot, body in _bodies(fault, scenario):
        damping = {
            "right": body.damping_right_wheel_N_m_s,
            "left": body.damping_left_wheel_N_m_s,
        }
        sides = ("right", "left") if fault.wheel == "both" else (fault.wheel,)
        if not any(damping[side] for side in sides):
            remedy = f"changes nothing: {robot}'s body.damping_{sides[0]}_wheel_N_m_s is 0"
            yield Problem(f"{where}.factor", fault.factor, remedy)


def _supply(
    fault: UnderVoltage | OverVoltage, where: str, scenario: "Scenario"
) -> Iterator[Problem]:
    own = scenario.supply.voltage_V
    sags = isinstance(fault, UnderVoltage)
    if (fault.voltage_V >= own) if sags else (fault.voltage_V <= own):
        remedy = f"must be {'below' if sags else 'above'} supply.voltage_V = {own:g}"
        yield Problem(f"{where}.voltage_V", fault.voltage_V, remedy)


def _bodies(fault: RobotFault, scenario: "Scenario") -> Iterator[tuple[str, "Body"]]:
    for robot in scenario.robot:
        if fault.robots is None or robot.name in fault.robots:
            yield robot.name, scenario.body_of(robot)


def _end_s(fault: Fault) -> float:
    return inf if fault.for_s is None else fault.at_s + fault.for_s


def _acts(fault: Fault, time_s: float) -> bool:
    return fault.at_s <= time_s < _end_s(fault)
