"""The closed loop of one case, tick by tick, in the order of `fleetloop.in_process`.

    share       path variables and speed estimates, every `share_every` ticks
    per robot   truth to the record; pose, every `localise_every`; encoders as float32;
                odometry and fix; coordination; reference; law; limits; torques as float32; body

Every equation is a function of `agents`, `plant` or `configs`: this module only calls them, in the
order in which the controller and the plant do. It is plain Python that numba compiles, with the
equations, as they stand in their sources (`fleetloop.sweep.kernel.linking`), and it runs uncompiled
just as well, only slowly.

A robot whose law asks for a torque that is no number stops itself; one whose body's motion diverges
stands still, its drives disarm, and it stops itself at their next heartbeat. A case that leaves
this course (a path variable or a pose out of reach, a robot that may arm again) isn't followed:
`simulate` says at which tick, and the case belongs to the reference.

Records of arrays have the fields of `fleetloop.sweep.kernel.layout`.
"""

from math import isfinite
from typing import Any

import numpy as np

from agents.coordination import Map, advanced, period_map
from agents.laws.adaptive_dsc import (
    Filters,
    approach,
    bound_estimate,
    surface,
    virtual_controls,
)
from agents.laws.adaptive_dsc_robust import adapt_normalised, at_limit, bounded_approach
from agents.laws.dsc_terms import Projection, adapt, clip, sense
from agents.laws.path_errors import path_errors
from agents.limits import limited
from agents.localisation import along, anchored, carried, heading_then, moved, nearest_turn
from agents.neighbours import extrapolated
from agents.paths import (
    Jet,
    PlanarJet,
    Point,
    circle_jet,
    cosine_jet,
    cosine_reference,
    figure_eight_jet,
    line_jet,
    shifted_reference,
    spline_jet,
    turning_reference,
    varying_jet,
)
from configs.reach import reached, within_world
from fleetloop.sweep.kernel.layout import (
    CIRCLE,
    COSINE,
    EXTERNAL,
    FIGURE_EIGHT,
    HEARD,
    LINE,
    ODOMETRY,
    OWN_ESTIMATE,
    ROBUST,
    STRUCTURE,
    WORLD,
)
from fleetloop.sweep.kernel.primitives import FLOAT32_MOST, float32
from plant.body import rolling_speeds
from plant.exact import shaft_motion
from plant.integrate import net_torques, runge_kutta, within_bounds

SATURATED = 3.4e38
"""What a torque beyond float32 is sent as: `bridge.drives.odrive.client.FLOAT32_MAX`."""
NOTHING, PATH_VARIABLE, POSE, TURN, REARMING = range(5)
"""Why a case left the course."""
GOING, TORQUE, DRIVES = range(3)
"""Why a robot stopped itself."""
MOST_TURN_RAD = 1e15
"""Whole turns beyond are no whole numbers any more."""


def simulate(  # noqa: C901 - one tick, in its order; arrays that functions are given cost time
    cases: Any,
    robots: Any,
    states: Any,
    edges: Any,
    changes: Any,
    leader_m_s: Any,
    curves: Any,
    maps: Any,
    rows: tuple[Any, Any],
    kept: tuple[Any, Any],
    room: tuple[Any, Any],
) -> tuple[int, int, int]:
    """Run one case from tick 0 to its end, or to the tick at which it leaves the course.

    Args:
        cases: one record of `layout.CASE`.
        robots: records of `layout.ROBOT`.
        states: of `layout.STATE`, at tick 0; at the end those of the end.
        edges: of `layout.EDGE`, those to each robot together, in the order of speakers' names, and
            the leader links.
        changes: of edges that change: from this tick on, this share counts.
        leader_m_s: v_r by tick, 0 where there is none to be heard.
        curves: knots of all splines; and their coefficients, twice: x and y, or ahead and left.
        maps: of `layout.MAP`, those of the coordination that were computed already; more are added.
        rows: records of `layout.TRUTH` and of `layout.TOLD`, one each, to write in.
        kept: numbers of the columns of these that are kept.
        room: for these columns of the plant and of the controllers: robot, tick, column; the first
            two columns, tick and time, are there.

    Returns:
        why it left the course, `NOTHING` if it didn't; the tick; the robot's number.
    """
    case, count, ticks = cases[0], len(robots), cases[0].ticks
    (truths, tolds), (kept_truth, kept_told), (plant_room, controller_room) = rows, kept, room
    truth, told = truths[0], tolds[0]
    truth_row, told_row = truths.view(np.float64), tolds.view(np.float64)
    slots = case.pose_delay_ticks + 1
    pasts = np.zeros((count, slots, 6))  # odometry and pose, by tick, the last ones
    shares = -(-ticks // case.share_every)
    said = np.zeros((shares, count, 2))  # s and v̂ of all, by share
    step_s = case.period_s / case.substeps
    share = 0
    for tick in range(ticks):
        t_ns = tick * case.period_ns
        t_s = t_ns * 1e-9
        fix_tick = tick - case.pose_delay_ticks
        localises = tick % case.localise_every == 0
        fixes = fix_tick >= 0 and fix_tick % case.localise_every == 0
        bus_ns = t_ns + case.countdown_ns
        beats = bus_ns // case.heartbeat_ns > (bus_ns - case.period_ns) // case.heartbeat_ns
        slot, fix_slot = tick % slots, fix_tick % slots
        if tick % case.share_every == 0:
            share = tick // case.share_every
            for i in range(count):
                state = states[i]
                said[share, i, 0], said[share, i, 1] = state.s, state.v_hat
                if not _is_reached(case, t_s, state.s, state.v_hat):
                    return PATH_VARIABLE, tick, i
        for i in range(count):
            robot, state = robots[i], states[i]
            if len(kept_truth):
                _tell_truth(truth, t_s, robot, state)
                for column in range(len(kept_truth)):
                    plant_room[i, tick, column + 2] = truth_row[kept_truth[column]]
            _measure(robot, state)
            if localises:
                if not within_world(state.x, state.y, state.theta):
                    return POSE, tick, i
                pasts[i, slot, 3], pasts[i, slot, 4] = state.x, state.y
                pasts[i, slot, 5] = state.theta
            pasts[i, slot, 0], pasts[i, slot, 1] = state.o_x, state.o_y
            pasts[i, slot, 2] = state.o_theta
            if fixes and case.localisation != ODOMETRY:
                odometry = (pasts[i, fix_slot, 0], pasts[i, fix_slot, 1], pasts[i, fix_slot, 2])
                x, y, theta = pasts[i, fix_slot, 3], pasts[i, fix_slot, 4], pasts[i, fix_slot, 5]
                if not _fix(state, x, y, theta, odometry):
                    return TURN, tick, i

            neighbours, degree, sum_s, sum_v = 0, 0.0, 0.0, 0.0
            for number in range(robot.first_edge, robot.last_edge):
                edge = edges[number]
                counts = share
                if not edge.steady:
                    while edge.next_change < edge.last_change:
                        if changes[edge.next_change, 0] > tick:
                            break
                        edge.counts = changes[edge.next_change, 1]
                        edge.next_change += 1
                    counts = edge.counts
                age_s = (t_ns - counts * case.share_every * case.period_ns) * 1e-9
                if counts < 0 or age_s > case.silence_limit_s:
                    continue
                age_s = min(age_s, case.age_limit_s)
                s_j, v_j, weight = (
                    said[counts, edge.speaker, 0],
                    said[counts, edge.speaker, 1],
                    edge.weight,
                )
                if case.extrapolates:
                    s_j = extrapolated(s_j, v_j, age_s, case.half_period_s)
                neighbours += 1
                degree += weight
                sum_s += weight * s_j
                sum_v += weight * v_j
            h = 0.0
            if robot.link >= 0:
                edge = edges[robot.link]
                while edge.next_change < edge.last_change:
                    if changes[edge.next_change, 0] > tick:
                        break
                    edge.counts = changes[edge.next_change, 1]
                    edge.next_change += 1
                h = edge.weight if edge.counts else 0.0
            s = state.s
            told.t_s, told.neighbours = t_s, neighbours
            told.s, told.mu, told.v_r_hat, told.s_dot = (
                s,
                state.mu,
                state.v_hat,
                state.mu + state.v_hat,
            )
            v_r = 0.0
            if robot.leader == HEARD:
                v_r = leader_m_s[tick]
            elif robot.leader == OWN_ESTIMATE:
                v_r = state.v_hat
            if degree != state.degree or h != state.h:
                _take_map(case, state, maps, degree, h)
            state.v_hat, state.mu, state.s = advanced(
                _kept_map(state), state.v_hat, state.mu, s, sum_s, sum_v, v_r
            )
            if case.path == COSINE and robot.offset == WORLD:
                reference = _cosine(robot, s)
            else:
                reference = _reference(case, robot, curves, s)
            if beats and state.diverged and state.stopped == GOING:
                state.stopped, state.stop_tick = DRIVES, tick
            if not _control(case, robot, state, told, reference, tick):
                return POSE, tick, i
            if state.stopped != GOING and case.rearms:
                return REARMING, tick, i
            for column in range(len(kept_told)):
                controller_room[i, tick, column + 2] = told_row[kept_told[column]]
            if not _is_reached(case, t_s + case.period_s, state.s, state.v_hat):
                return PATH_VARIABLE, tick, i
            _advance(case.substeps, step_s, robot, state, t_s, tick)
    return NOTHING, ticks, 0


def _is_reached(case: Any, t_s: float, s: float, v_hat: float) -> bool:
    """Whether a path variable is within the reach of the scenario."""
    low, high = reached(t_s, case.s_min_m, case.s_max_m, case.v_min_m_s, case.v_max_m_s)
    return low <= s <= high and case.v_low_m_s <= v_hat <= case.v_high_m_s


def _tell_truth(truth: Any, t_s: float, robot: Any, state: Any) -> None:
    """The plant's row."""
    truth.t_s = t_s
    truth.x_m, truth.y_m, truth.theta_rad = state.x, state.y, state.theta
    truth.v_m_s, truth.omega_rad_s = state.v, state.omega
    truth.input_right_wheel_N_m = state.torque_right_shaft * robot.gear_right
    truth.input_left_wheel_N_m = state.torque_left_shaft * robot.gear_left
    truth.demand_right_wheel_N_m = truth.motor_right_wheel_N_m = state.demand_right
    truth.demand_left_wheel_N_m = truth.motor_left_wheel_N_m = state.demand_left


# --- what the controller knows --------------------------------------------------------------------


def _measure(robot: Any, state: Any) -> None:
    """Encoders, as the bus carries them; odometry and speeds from them."""
    speeds = rolling_speeds(state.v, state.omega, robot.half_track, robot.inv_right, robot.inv_left)
    right_rev, right_rev_s = shaft_motion(state.right_wheel_rad, speeds[0], robot.gear_right)
    left_rev, left_rev_s = shaft_motion(state.left_wheel_rad, speeds[1], robot.gear_left)
    right_rad = float32(right_rev + 0.0) * robot.wheel_rad_per_rev_right  # + the offset of a drive
    left_rad = float32(left_rev + 0.0) * robot.wheel_rad_per_rev_left
    right_rad_s = float32(right_rev_s) * robot.wheel_rad_per_rev_right
    left_rad_s = float32(left_rev_s) * robot.wheel_rad_per_rev_left
    half, half_over_b = robot.half_radius, robot.half_radius_over_b
    distance, turn = along(
        right_rad - state.seen_right_rad, left_rad - state.seen_left_rad, half, half_over_b
    )
    state.o_x, state.o_y, state.o_theta = moved(
        (state.o_x, state.o_y, state.o_theta), distance, turn
    )
    state.seen_right_rad, state.seen_left_rad = right_rad, left_rad
    state.v_used, state.omega_used = along(right_rad_s, left_rad_s, half, half_over_b)


def _anchor(state: Any) -> tuple[float, float, float, float, float, float, float, float]:
    """The anchor of a state."""
    return (
        *(state.f_x, state.f_y, state.f_theta),
        *(state.a_x, state.a_y, state.a_theta, state.a_cos, state.a_sin),
    )


def _fix(
    state: Any, x: float, y: float, theta: float, odometry: tuple[float, float, float]
) -> bool:
    """Take a pose of the instant of this odometry; False if its turns can't be counted."""
    then = heading_then(_anchor(state), odometry)
    if not abs(then) < MOST_TURN_RAD:
        return False
    anchor = anchored(x, y, nearest_turn(theta, then), odometry)
    state.f_x, state.f_y, state.f_theta = anchor[0], anchor[1], anchor[2]
    state.a_x, state.a_y, state.a_theta = anchor[3], anchor[4], anchor[5]
    state.a_cos, state.a_sin = anchor[6], anchor[7]
    return True


# --- the controller -------------------------------------------------------------------------------


def _take_map(case: Any, state: Any, maps: Any, degree: float, h: float) -> None:
    """Take the coordination's map of another d and h, one that is there or a new one."""
    state.degree, state.h = degree, h
    for n in range(len(maps)):
        known = maps[n]
        if not known.computed:
            known.computed, known.degree, known.h = 1, degree, h
            _keep_map(known, period_map(case.p, case.q, degree, h, case.period_s))
        if known.degree == degree and known.h == h:
            _keep_map(state, _kept_map(known))
            return
    _keep_map(state, period_map(case.p, case.q, degree, h, case.period_s))


def _keep_map(state: Any, rows: Map) -> None:
    """Keep the coordination's map, of a robot until its degree changes."""
    v, mu, s = rows
    state.v_1, state.v_2, state.v_3 = v
    state.mu_1, state.mu_2, state.mu_3, state.mu_4, state.mu_5, state.mu_6 = mu
    state.s_1, state.s_2, state.s_3, state.s_4, state.s_5, state.s_6 = s


def _kept_map(state: Any) -> Map:
    return (
        (state.v_1, state.v_2, state.v_3),
        (state.mu_1, state.mu_2, state.mu_3, state.mu_4, state.mu_5, state.mu_6),
        (state.s_1, state.s_2, state.s_3, state.s_4, state.s_5, state.s_6),
    )


def _control(
    case: Any,
    robot: Any,
    state: Any,
    told: Any,
    reference: Point,
    tick: int,
) -> bool:
    """Torques to the drives, by what the controller knows; False: that isn't finite."""
    if case.localisation == EXTERNAL:
        x, y, theta = state.f_x, state.f_y, state.f_theta
    else:
        x, y, theta = carried(_anchor(state), (state.o_x, state.o_y, state.o_theta))
    if not isfinite(x + y + theta + state.v_used + state.omega_used):
        return False
    told.x_used_m, told.y_used_m, told.theta_used_rad = x, y, theta
    told.v_used_m_s, told.omega_used_rad_s = state.v_used, state.omega_used
    x_d, y_d, theta_d, v_bar_d, omega_bar_d = reference
    told.x_d_m, told.y_d_m, told.theta_d_rad = x_d, y_d, theta_d
    x_e, y_e, theta_e = path_errors(x, y, theta, x_d, y_d, theta_d)
    told.x_e_m, told.y_e_m, told.theta_e_rad = x_e, y_e, theta_e
    right, left = _law(robot, state, told, v_bar_d, omega_bar_d)
    if state.stopped == GOING and not isfinite(right + left):
        state.stopped, state.stop_tick = TORQUE, tick
    if state.stopped != GOING:
        right = left = 0.0
    _send(robot, state, right, left)
    told.tau_right_wheel_N_m = state.torque_right_shaft * robot.to_wheel_right
    told.tau_left_wheel_N_m = state.torque_left_shaft * robot.to_wheel_left
    return True


def _law(
    robot: Any, state: Any, told: Any, v_bar_d: float, omega_bar_d: float
) -> tuple[float, float]:
    """The torques of the paper's law or of the robust one, limited by the host; its next state.

    A robot that has stopped, or does so now, keeps its state.
    """
    v, omega, s_dot = state.v_used, state.omega_used, told.s_dot
    x_e, y_e, theta_e = told.x_e_m, told.y_e_m, told.theta_e_rad
    k1, k2, k3, k4 = robot.k1, robot.k2, robot.k3, robot.k4
    robust = robot.law == ROBUST
    if robust:
        closing, bar_theta = bounded_approach(x_e, sense(s_dot) * y_e, k1, k2, robot.v_limit)
    else:
        closing, bar_theta = approach(x_e, sense(s_dot) * y_e, k1, k2)
    bar_v, turn = virtual_controls(closing, bar_theta, theta_e, s_dot, v_bar_d, omega_bar_d, k3)
    filters: Filters = (bar_theta, bar_v, turn)
    if state.started:
        filters = (state.alpha_theta, state.alpha_v, state.alpha_omega)
    theta_1 = (state.theta_1, state.theta_2, state.theta_3, state.theta_4)
    theta_2 = (state.theta_5, state.theta_6, state.theta_7, state.theta_8)
    kappa = state.kappa
    constants = (
        (k1, k2, k3, k4),
        (robot.gamma_1, robot.gamma_2, robot.gamma_3),
        (robot.move_1, robot.move_2, robot.move_3),
        (robot.kappa_keep, robot.kappa_gain, robot.sgn_width),
        (robot.radius, robot.half_track_known),
    )
    right, left, after, f_1, f_2, e_1, e_2 = surface(
        constants, v, omega, bar_theta, bar_v, turn, filters, theta_1, theta_2, kappa
    )
    told.alpha_theta_rad, told.alpha_v_m_s, told.alpha_omega_rad_s = filters
    told.xi_e1_m_s, told.xi_e2_rad_s, told.kappa_hat = e_1, e_2, kappa
    told.theta_hat_1, told.theta_hat_2, told.theta_hat_3, told.theta_hat_4 = theta_1
    told.theta_hat_5, told.theta_hat_6, told.theta_hat_7, told.theta_hat_8 = theta_2
    learns = True
    if robust and at_limit(right, left, robot.torque_limit):
        right, left = clip(right, robot.torque_limit), clip(left, robot.torque_limit)
        learns = False
    if state.stopped != GOING or not isfinite(right + left):
        return right, left
    if robot.host_limits:
        asked_right, asked_left = right, left
        right = limited(right, state.limited_right, robot.host_limit, robot.host_step)
        left = limited(left, state.limited_left, robot.host_limit, robot.host_step)
        state.limited_right, state.limited_left = right, left
        learns = learns and right == asked_right and left == asked_left
    state.started = 1
    state.alpha_theta, state.alpha_v, state.alpha_omega = after
    if learns:
        bounds = Projection(robot.sigma, robot.sigma_square, robot.sigma_span, robot.sigma_limit)
        rates_1 = (robot.rate_1, robot.rate_2, robot.rate_3, robot.rate_4)
        rates_2 = (robot.rate_5, robot.rate_6, robot.rate_7, robot.rate_8)
        if robust:
            theta_1 = adapt_normalised(theta_1, f_1, e_1, rates_1, bounds, k4)
            theta_2 = adapt_normalised(theta_2, f_2, e_2, rates_2, bounds, k4)
        else:
            theta_1 = adapt(theta_1, f_1, e_1, rates_1, bounds)
            theta_2 = adapt(theta_2, f_2, e_2, rates_2, bounds)
        state.theta_1, state.theta_2, state.theta_3, state.theta_4 = theta_1
        state.theta_5, state.theta_6, state.theta_7, state.theta_8 = theta_2
        state.kappa = bound_estimate(kappa, e_1, e_2, robot.kappa_keep, robot.kappa_gain)
    return right, left


def _send(robot: Any, state: Any, right: float, left: float) -> None:
    """Torques to the drives, as float32 carries them; if one of them is beyond, both saturate."""
    right *= robot.to_shaft_right
    left *= robot.to_shaft_left
    right_32, left_32 = float32(right), float32(left)
    if abs(right_32) > FLOAT32_MOST or abs(left_32) > FLOAT32_MOST:
        right_32, left_32 = float32(clip(right, SATURATED)), float32(clip(left, SATURATED))
    state.torque_right_shaft, state.torque_left_shaft = right_32, left_32


# --- the path -------------------------------------------------------------------------------------


def _cosine(robot: Any, s: float) -> Point:
    """The robot's reference at s on the paper's path."""
    return cosine_reference(
        s, robot.path_1, robot.path_2, robot.path_3, robot.path_4, robot.path_5, robot.path_6
    )


def _reference(case: Any, robot: Any, curves: Any, s: float) -> Point:
    """The robot's reference at s on any other path."""
    centre = _centre(case, curves, s)
    if robot.offset == WORLD:
        return shifted_reference(centre, robot.path_1, robot.path_2)
    if robot.offset == STRUCTURE:
        ahead = Jet(robot.path_1, 0.0, 0.0, 0.0)
        place = PlanarJet(ahead, Jet(robot.path_2, 0.0, 0.0, 0.0))
    else:
        knots, first, second = curves
        a, b = robot.first_knot, robot.last_knot
        place = varying_jet(s, knots[a:b], first[a : b - 1], second[a : b - 1])
    return turning_reference(centre, place)


def _centre(case: Any, curves: Any, s: float) -> PlanarJet:
    """The jets of the formation's centre at s."""
    one, two, three, four, five = case.path_1, case.path_2, case.path_3, case.path_4, case.path_5
    if case.path == COSINE:
        return cosine_jet(s, one, two, three, four)
    if case.path == LINE:
        return line_jet(s, one, two, three, four)
    if case.path == CIRCLE:
        return circle_jet(s, one, two, three, four, five)
    if case.path == FIGURE_EIGHT:
        return figure_eight_jet(s, one, two, three, four, five)
    knots, first, second = curves
    b = case.last_knot
    return spline_jet(s, knots[:b], first[: b - 1], second[: b - 1], case.closed)


# --- the robot ------------------------------------------------------------------------------------


def _advance(substeps: int, step_s: float, robot: Any, state: Any, t_s: float, tick: int) -> None:
    """The body over one period, torques held; where its motion diverges it stands still."""
    right_shaft, left_shaft = state.torque_right_shaft, state.torque_left_shaft
    if state.stopped != GOING or state.diverged:  # the drives are disarmed
        right_shaft = left_shaft = 0.0
    right, left = right_shaft * robot.gear_right, left_shaft * robot.gear_left
    state.demand_right, state.demand_left = right, left
    if state.diverged:
        return
    rolling = (
        *(robot.centrifugal, robot.coriolis),
        *(robot.damping_11, robot.damping_12, robot.damping_21, robot.damping_22),
        *(robot.gain_1, robot.gain_2),
    )
    waves = (robot.amplitude, robot.wave_rate, robot.phase)
    motion = (
        *(state.x, state.y, state.theta, state.v, state.omega),
        *(state.right_wheel_rad, state.left_wheel_rad),
    )
    half_track = robot.half_track
    for n in range(substeps):
        if robot.disturbed:
            net = net_torques(right, left, waves, t_s + n * step_s, step_s)
        else:
            net = (right, left, right, left, right, left)
        after = runge_kutta(
            rolling, None, motion, net, step_s, half_track, robot.inv_right, robot.inv_left
        )
        if not within_bounds(after, half_track, robot.fastest_m_s):
            x, y, theta, v, omega, right_rad, left_rad = motion
            state.diverged, state.diverged_tick = 1, tick
            state.diverged_v, state.diverged_omega = v, omega
            state.diverged_right, state.diverged_left = right, left
            motion = (x, y, theta, 0.0, 0.0, right_rad, left_rad)
            break
        motion = after
    state.x, state.y, state.theta, state.v, state.omega = motion[:5]
    state.right_wheel_rad, state.left_wheel_rad = motion[5], motion[6]
