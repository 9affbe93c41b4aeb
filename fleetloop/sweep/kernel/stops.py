"""Robots that stopped themselves, and bodies whose motion diverged: events, and reasons in words.

The words are the controllers' (`agents.guard`), the drives' and the plant's.
"""

from math import ceil

import numpy as np
from numpy.typing import NDArray

from configs.brief import Schedule
from configs.events import Event
from configs.scenario import Scenario
from fleetloop.in_process.run import PROGRESS_EVERY_TICKS
from fleetloop.sweep.kernel.loop import DRIVES, GOING
from plant.divergence import Divergence

NOT_FINITE = "the law asks for a torque that is not finite"
LOST_ESTIMATE = "right drive (node {}) dropped out: MISSING_ESTIMATE"


def stop_events(scenario: Scenario, robot: str, state: np.void) -> list[Event]:
    """The events of a robot's controller from tick 0 on; `state`: at the end."""
    tick = int(state["stop_tick"])
    if state["stopped"] == GOING:
        return []
    reason, events = NOT_FINITE, []
    if state["stopped"] == DRIVES:
        reason = LOST_ESTIMATE.format(scenario.nodes_of(robot)[0])
        events = [Event(tick, robot, "drive_error", reason)]
    return [*events, Event(tick, robot, "stopped", reason)]


def divergences(scenario: Scenario, states: NDArray[np.void], ticks: Schedule) -> list[Event]:
    """The events of the plant, in the order in which it notes them: it looks now and then."""
    found = []
    for robot, state in zip(scenario.names, states, strict=True):
        if state["diverged"]:
            tick = int(state["diverged_tick"])
            speeds = float(state["diverged_v"]), float(state["diverged_omega"])
            torques = float(state["diverged_right"]), float(state["diverged_left"])
            t_s = tick * ticks.period_ns * 1e-9
            text = str(Divergence(t_s, *speeds, *torques))
            found.append(Event(round(t_s * 1e9) // ticks.period_ns, robot, "diverged", text))
    return sorted(found, key=lambda it: ceil(it.tick / PROGRESS_EVERY_TICKS))
