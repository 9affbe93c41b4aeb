"""Findings about shafts: their speed against the drives' limit, and the jitter of their encoders.

    n = gear |ν| / 2π                                        shaft speed along the course, rev/s
    σ_v = √(1/12 + σ²) √(w³ / (4 f)) / N                     rms of the drive's velocity, rev/s  (1)
    σ_τ = k_4 2π σ_v / gear                                  rms at a wheel that it makes        (2)

(1): counts, N a revolution, are taken as white noise over one count beside their own of σ, behind
the drive's loop with both poles at w, run f times a second. Of real counts, which beat with the
loop, it is the order: at some speeds they make nothing, at the worst ones up to four times as much.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import pi, sqrt

import numpy as np

from configs.powertrain import Encoder
from configs.scenario import Scenario
from fleetloop.check.course import Course
from fleetloop.check.finding import Finding, Level
from fleetloop.check.torque import needed
from fleetloop.law_facts import speed_gain, speed_gain_key

SPARE = 0.8
"""Part of the velocity limit up to which a speed leaves torque enough."""
JITTER_PART = 0.25
"""Part of the needed torque that jitter may be."""


def wheel_findings(scenario: Scenario, courses: list[Course]) -> Iterator[Finding]:
    """Shaft speed and encoder jitter of every robot, where drives have them."""
    preset = scenario.drive.preset
    for course in courses:
        if preset != "ideal":
            yield from _speed(scenario, course)
        if preset == "realistic":
            yield from _jitter(scenario, course)


def encoder_jitter_shaft_rev_s(encoder: Encoder) -> float:
    """(1)."""
    counts = sqrt(1.0 / 12.0 + encoder.noise_counts**2)
    bandwidth = encoder.pll_bandwidth_rad_s
    through = sqrt(bandwidth**3 / (4.0 * encoder.pll_rate_Hz))
    return counts * through / encoder.counts_per_shaft_rev


def _speed(scenario: Scenario, course: Course) -> Iterator[Finding]:
    """The speed of a shaft along the course; where it is the limit, no torque is left."""
    bound = scenario.drive.velocity_limit()
    if bound is None:
        return
    gear = scenario.mounting_of(course.robot).gear_ratio
    shaft = np.abs(needed(scenario, course).nu_wheel_rad_s) * gear / (2.0 * pi)
    most, mean = float(shaft.max()), float(shaft.mean(axis=0).max())
    fine = Finding(
        "ok",
        "shaft speed along the path",
        f"{most:.3g} rev/s, gear {gear:g}",
        (course.robot.name,),
        limit=f"≤ {SPARE:.0%} of {bound.limit_shaft_rev_s:g} rev/s",
        basis="gear |ν| / 2π",
    )
    if most <= SPARE * bound.limit_shaft_rev_s:
        yield fine
    else:
        level: Level = "error" if mean >= bound.limit_shaft_rev_s else "warning"
        remedy = f"raise {bound.key}, a smaller mounting.gear_ratio, or go slower"
        yield replace(fine, level=level, key=bound.key, remedy=remedy)


def _jitter(scenario: Scenario, course: Course) -> Iterator[Finding]:
    """What the law makes of the noise in measured speeds."""
    control = scenario.control_of(course.robot)
    gain = speed_gain(control)
    if gain is None:
        return
    encoder = scenario.encoder
    gear = scenario.mounting_of(course.robot).gear_ratio
    jitter = gain * 2.0 * pi * encoder_jitter_shaft_rev_s(encoder) / gear
    need = float(np.abs(needed(scenario, course).torque_wheel_N_m).max())
    fine = Finding(
        "ok",
        "torque jitter by encoder counts",
        f"{jitter:.3g} N·m rms, {encoder.counts_per_shaft_rev} counts",
        (course.robot.name,),
        limit=f"≤ {JITTER_PART * need:.3g} N·m, a quarter of the need",
        basis="k_4 × rms speed noise of the drive's estimator",
    )
    if jitter <= JITTER_PART * need:
        yield fine
    else:
        name = speed_gain_key(control)
        remedy = "more counts, or a slower encoder.pll_bandwidth_rad_s"
        remedy += f", or a smaller control.{name}" if name else ""
        yield replace(fine, level="warning", key="encoder.counts_per_shaft_rev", remedy=remedy)
