"""Findings about gains and rate: the speed loop and the whole channel of every robot.

A torque comes late by the time of its frames on the wire, the firmware's latency, the motor's
current loop and the drive's velocity estimator. With a known delay, half of the speed loop's limit
is a good gain: k_4 = 0.25 min(m̄)/h where torques come one period late.

Both are looked at for every law that tells its part: `Law.speed_gain_N_m_s`, `Law.loop_elements`.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import inf

import numpy as np

from agents.laws.failure import raised
from agents.laws.interface import LoopElement
from bridge.frame import Frame
from bridge.wire.bits import frame_bits
from configs.brief import Wheels
from configs.plugins import Choice
from configs.resolve import schedule
from configs.scenario import Scenario
from configs.sections import Robot
from fleetloop.check.body import inertias, robot_body
from fleetloop.check.course import Course
from fleetloop.check.finding import Finding, Level
from fleetloop.check.law import ANALYSES
from fleetloop.check.loop import (
    Loop,
    bisect,
    channel_radius,
    delay_margin_s,
    elements,
    largest_gain,
    pole_time_s,
    speed_loop_radius,
    with_gain,
)
from fleetloop.law_facts import loop_gains, offers, speed_gain, speed_gain_key
from fleetloop.torque_limits import limits

Arc = tuple[float, float, float]
"""v̄_d, ω̄_d and ṡ of steady motion."""
Arcs = list[Arc]
HELD_PERIODS = 20
"""Of a pose held for longer the hold is to blame: neither margin nor gains are looked for."""
_POSES = "clock.localisation_period_s"
_FRAMES = 4
"""On a wire before both torques are there: two encoder frames, two torques."""
_SPEED_LOOP = "(34) sampled: K < 2 sin(π / (2 (2 d + 1)))"
_CHANNEL = "spectral radius, linearised on line and arc"
_CYCLES = 3.0
"""Errors that take longer than a third of the run to decay are said."""


def sampling_findings(scenario: Scenario, courses: list[Course]) -> Iterator[Finding]:
    """Speed loop and channel of every robot; alike robots are computed once."""
    known: dict[tuple[object, ...], list[Finding]] = {}
    for course in courses:
        robot, control = course.robot, scenario.control_of(course.robot)
        loop, arcs = loop_of(scenario, robot), _arcs(course)
        alike = (
            control.name,
            repr(loop.gains),
            loop.wheels,
            scenario.body_of(robot),
            loop.torque_delay_s,
            bool(limits(scenario, robot)),
            tuple(np.round(arcs, 2).ravel().tolist()),
        )
        if alike not in known:
            known[alike] = [
                *_speed_loop(scenario, robot, control),
                *_channel_of(scenario, control, loop, arcs),
            ]
        yield from (replace(finding, robots=(robot.name,)) for finding in known[alike])


def loop_of(scenario: Scenario, robot: Robot) -> Loop:
    """The loops of one robot; what adapts is as it starts."""
    control, body = scenario.control_of(robot), scenario.body_of(robot)
    ticks = schedule(scenario)
    external = scenario.localisation.source == "external"
    return Loop(
        control.load(),
        control.parameters,
        Wheels(body.wheel_radius_m, body.half_track_m),
        robot_body(body),
        ticks.period_s,
        torque_delay_s(scenario),
        ticks.localise_every if external else 1,
        ticks.pose_delay_ticks if external else 0,
    )


def torque_delay_s(scenario: Scenario) -> float:
    """From a tick to its torque at the wheel, about, and what else lags in the speed loop."""
    drive, motor, encoder = scenario.drive, scenario.motor, scenario.encoder
    delay_s = 0.0
    if scenario.bus.timing == "wire":
        delay_s += _FRAMES * frame_bits(Frame(0x29, bytes(range(8)))) / scenario.bus.bitrate_bit_s
    if drive.preset == "realistic":
        if scenario.bus.timing == "wire":
            delay_s += 0.5 * sum(drive.command_latency_s)
        delay_s += motor.compute_delay_s + motor.current_loop_s
        delay_s += 2.0 / encoder.pll_bandwidth_rad_s
    return delay_s


def speed_loop_gains(scenario: Scenario, robot: Robot) -> tuple[float, float] | None:
    """K = k_4 h / min(m̄) of a robot and the K up to which (34) sampled is stable.

    None: its law tells no speed gain.
    """
    of_law = speed_gain(scenario.control_of(robot))
    if of_law is None or of_law <= 0.0:
        return None
    h = schedule(scenario).period_s
    gain, delay = of_law * h / min(inertias(scenario.body_of(robot))), torque_delay_s(scenario) / h
    return gain, bisect(lambda k: speed_loop_radius(k, delay) < 1.0, 0.0, 4.0, 24)


def _arcs(course: Course) -> Arcs:
    """(v̄_d, ω̄_d, ṡ) of the straightest and of the most curved place, at the final speed."""
    turn = np.abs(course.omega_bar)
    places = dict.fromkeys((int(turn.argmin()), int(turn.argmax())))
    s_dot = float(course.v[-1] / course.v_bar[-1]) if course.v_bar[-1] > 0 else 0.0
    return [(float(course.v_bar[n]), float(course.omega_bar[n]), s_dot) for n in places]


def _speed_loop(scenario: Scenario, robot: Robot, control: Choice) -> Iterator[Finding]:
    """The speed gain against rate and delay; limited torques swing, others grow without end."""
    of_law, name = speed_gain(control), speed_gain_key(control)
    found = speed_loop_gains(scenario, robot)
    if of_law is None or found is None:
        return
    gain, most = found
    h, late_s = schedule(scenario).period_s, torque_delay_s(scenario)
    inertia = min(inertias(scenario.body_of(robot)))
    delay = late_s / h
    title = f"sampled speed loop {name or 'k'} h / min(m̄)"
    late = f" with torques {1e3 * late_s:.2g} ms late" if delay else ""
    said, limit = f"{gain:.3g}", f"< {most:.3g}{late}"
    suits = 0.25 * min(most, 1.0) * inertia / h
    key, remedy = "control.law", f"a speed gain of {suits:.3g} suits this rate, not {of_law:.3g}"
    if name:
        key = f"control.{name}"
        remedy = f"{key} = {suits * (getattr(control.parameters, name) / of_law):.3g}"
        remedy += " suits this rate"
    if all(speed_loop_radius(gain, part * delay) >= 1.0 for part in (0.5, 1.0, 1.5)):
        level: Level = "warning" if limits(scenario, robot) else "error"
        swings = "diverges" if level == "error" else "torques swing between their limits"
        said += f": {swings}"
        yield Finding(level, title, said, key=key, limit=limit, remedy=remedy, basis=_SPEED_LOOP)
    elif gain > 0.5 * most:
        limit += ", good below half of it"
        yield Finding(
            "warning", title, said, key=key, limit=limit, remedy=remedy, basis=_SPEED_LOOP
        )
    else:
        yield Finding("ok", title, said, limit=limit, basis=_SPEED_LOOP)


def _channel_of(scenario: Scenario, control: Choice, loop: Loop, arcs: Arcs) -> list[Finding]:
    """The channel of a law that tells its part; of a part that fails, the failure."""
    if not offers(control, "loop_elements") or min(s_dot for _, _, s_dot in arcs) <= 0.0:
        return []
    try:
        return list(_channel(scenario, control, loop, arcs))
    except (Exception, SystemExit) as error:  # the law's own code
        text = f"{ANALYSES['loop_elements']}: law {control.name}, loop_elements: {raised(error)}"
        return [Finding("warning", "not analysed", text, key="control.law", basis="the law")]


def _channel(scenario: Scenario, control: Choice, loop: Loop, arcs: Arcs) -> Iterator[Finding]:
    """The law's gains against its fast states, the speed loop and the period."""
    parts = elements(loop, *arcs[0])
    if not parts:
        return
    states = f", {parts[0].states} and speeds" if parts[0].states else " and speeds"
    title = f"channel radius of x_e, y_e, θ_e{states}"
    at_start = [channel_radius(loop, *arc) for arc in arcs]
    worst = int(np.argmax(at_start))
    radius, arc = at_start[worst], arcs[worst]
    said = f"{radius:.6g}"
    if len(parts) > 1:
        learnt = replace(loop, learnt=True)
        later = max(channel_radius(learnt, *arc) for arc in arcs)
        said += f" for Θ̂ = 0, {later:.6g} for the true Θ,"
        if radius < 1.0 <= later:
            radius, loop = later, learnt
    if radius >= 1.0 + 1e-9:
        remedies = {} if loop.pose_every > HELD_PERIODS else _remedies(loop, arc)
        key = f"control.{next(iter(remedies), next(iter(_gains(loop)), 'law'))}"
        key = _POSES if loop.pose_every > HELD_PERIODS else key
        said += f" per period of {loop.period_s:g} s{_lags(loop, parts[0])}: the errors swing"
        remedy = _lower(loop, parts[0], remedies)
        yield Finding("warning", title, said, key=key, limit="< 1", remedy=remedy, basis=_CHANNEL)
        return
    slowest_s = pole_time_s(radius, loop.period_s)
    said += f" per period, slowest error decays in {slowest_s:.3g} s"
    margin_s = inf
    if loop.pose_every <= HELD_PERIODS:
        margin_s = delay_margin_s(loop, *arc)
        said += f"; tolerates torques {1e3 * margin_s:.3g} ms late"
    if _CYCLES * slowest_s > scenario.duration_s:
        slow = _slowest_gain(loop, arc)
        limit = f"< 1, decay within {scenario.duration_s / _CYCLES:.3g} s"
        remedy = f"raise control.{slow}" if slow else "a faster law, or a longer duration_s"
        key = f"control.{slow or 'law'}"
        yield Finding("warning", title, said, key=key, limit=limit, remedy=remedy, basis=_CHANNEL)
    elif margin_s < loop.period_s:
        key = f"control.{speed_gain_key(control) or 'law'}"
        limit, remedy = "< 1, with a period of delay", "lower it, or a higher rate"
        yield Finding("warning", title, said, key=key, limit=limit, remedy=remedy, basis=_CHANNEL)
    else:
        yield Finding("ok", title, said, limit="< 1", basis=_CHANNEL)


def _gains(loop: Loop) -> tuple[str, ...]:
    return loop_gains(loop.law, loop.gains)


def _remedies(loop: Loop, arc: Arc) -> dict[str, float]:
    """Gains of which lowering one alone is enough, and how far."""
    found = {name: largest_gain(loop, name, *arc) for name in _gains(loop)}
    return {
        name: value
        for name, value in found.items()
        if 0.1 * getattr(loop.gains, name) < value < getattr(loop.gains, name)
    }


def _slowest_gain(loop: Loop, arc: Arc) -> str:
    """The gain of which a higher one shortens the slowest decay most; "" if none does."""
    radii = {
        name: channel_radius(with_gain(loop, name, 1.2 * getattr(loop.gains, name)), *arc)
        for name in _gains(loop)
    }
    best = min(radii, key=lambda name: radii[name], default="")
    return best if best and radii[best] < channel_radius(loop, *arc) else ""


def _lags(loop: Loop, part: LoopElement) -> str:
    lags = []
    if part.time_constants_s:
        lags.append(f"{part.states} of {', '.join(f'{lag:g}' for lag in part.time_constants_s)} s")
    if loop.pose_every > 1:
        lags.append(f"poses held {loop.pose_every * loop.period_s:g} s")
    return f" with {', '.join(lags)}" if lags else ""


def _lower(loop: Loop, part: LoopElement, remedies: dict[str, float]) -> str:
    each = [
        f"{name} = {0.5 * value:.3g} (it is {getattr(loop.gains, name):g})"
        for name, value in remedies.items()
    ]
    what = f"control.{' or '.join(each)} suits" if each else "lower the gains together"
    if loop.pose_every > HELD_PERIODS:
        what = 'localisation.source = "fused", or more fixes'
    shorter = f" with shorter {part.states}" if part.time_constants_s else ""
    return f"{what}, or a higher rate{shorter}"
