"""Findings about poses: held between fixes, and delayed or lost on an emulated edge.

A robot whose newest pose is older than `host.pose_age_limit_s` stops itself. The ages are those of
the edge from the localisation system with the run's seed, so they are the run's.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bridge.netem.channel import Channel
from configs.emulated_edges import EmulatedEdge, effects_of
from configs.netem import LOCALISATION, Effects
from configs.resolve import pose_age_limit_s, schedule
from configs.scenario import Scenario
from fleetloop.check.course import Course
from fleetloop.check.finding import Finding

HELD_M = 0.05
"""A reference that moves on by more than this while a pose is held is said."""
MOST_FIXES = 60_000
"""Fixes that are followed through their channels for a scenario, all robots together."""
_PERIOD = "clock.localisation_period_s"


def pose_findings(scenario: Scenario, courses: list[Course]) -> Iterator[Finding]:
    """Held poses, and ages on the emulated edges, of every robot."""
    for course in courses:
        yield from _held(scenario, course)
        yield from _aged(scenario, course.robot.name, MOST_FIXES // len(courses))


def oldest_s(effects: Effects, seed: str, scenario: Scenario, most_fixes: int) -> float:
    """The largest age of the newest pose over a run, or its first fixes [s]."""
    ticks = schedule(scenario)
    every_ns = ticks.period_ns * ticks.localise_every
    late_ns = ticks.period_ns * ticks.pose_delay_ticks
    channel: Channel[None] = Channel(effects, seed, 0)
    newest_ns = oldest_ns = 0
    for n in range(min(ticks.ticks // ticks.localise_every, most_fixes)):
        sent_ns = n * every_ns
        oldest_ns = max(oldest_ns, sent_ns + late_ns - newest_ns)
        channel.send(sent_ns, None)
        arrived = channel.receive(sent_ns + late_ns)
        newest_ns = max([newest_ns, *(sent for sent, _ in arrived)])
    return oldest_ns * 1e-9


def _aged(scenario: Scenario, robot: str, most_fixes: int) -> Iterator[Finding]:
    """The largest age of a pose on an emulated edge, against the age at which the robot stops."""
    effects = effects_of(scenario.network, EmulatedEdge(LOCALISATION, robot))
    if effects == Effects() or scenario.localisation.source == "odometry":
        return
    limit_s = pose_age_limit_s(scenario)
    age_s = oldest_s(effects, f"{scenario.seed} {LOCALISATION} -> {robot}", scenario, most_fixes)
    fine = Finding(
        "ok",
        "age of poses",
        f"up to {age_s:.3g} s in this run",
        (robot,),
        limit=f"≤ {limit_s:g} s, or the robot stops",
        basis="the emulated edge with its seed",
    )
    if age_s <= limit_s:
        yield fine
    else:
        remedy = "raise it, or shorter delays and fewer losses of the localisation's edge"
        yield replace(fine, level="error", key="host.pose_age_limit_s", remedy=remedy)


def _held(scenario: Scenario, course: Course) -> Iterator[Finding]:
    """How far the reference moves on while a pose is held."""
    if scenario.localisation.source != "external":
        return
    clock = scenario.clock
    delay_s = scenario.localisation.delay_s
    late_s = clock.control_period_s if delay_s is None else delay_s
    speed = float(np.abs(course.v).max())
    held_s = clock.localisation_period_s
    moved = speed * (held_s + late_s)
    title = "poses held between fixes"
    said = f"held {held_s:g} s, {late_s:g} s late, at {speed:.3g} m/s: the reference moves on"
    said += f" {moved:.2g} m"
    finding = Finding(
        "ok", title, said, (course.robot.name,), limit=f"≤ {HELD_M:g} m", basis="v̄_d ṡ × age"
    )
    if moved > HELD_M:
        remedy = 'localisation.source = "fused" carries poses on by odometry, or more fixes'
        finding = replace(finding, level="warning", key=_PERIOD, remedy=remedy)
    yield finding
