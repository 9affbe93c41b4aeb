"""A scenario as the numbers of one case, as its briefs and the constructors of its parts make them.

Numbers that equations need once are computed by the functions that those parts call. What cases of
a sweep have in common is computed once, and looked up by its value.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import inf, nan
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from agents.laws.adaptive_dsc import adaptation_rates, law_constants
from agents.laws.dsc_terms import Projection
from agents.laws.gains import AdaptiveDscGains, AdaptiveDscRobustGains
from agents.localisation import anchored
from agents.paths import circle_rate, cosine_numbers, line_tangent
from bridge.drives.interface import torque_factors, wheel_rad_per_shaft_rev
from configs import paths, sections
from configs.brief import ChannelModel, Schedule, WheelDisturbance, Wheels
from configs.curves import SplinePath, VaryingOffset, formation_offset, reference_path
from configs.edges import InEdge
from configs.graph import Graph
from configs.leader_speed import speed_at
from configs.parameters import Parameters, changed, extended
from configs.resolve import channels, speed_changes, substeps
from configs.scenario import Scenario
from fleetloop.sweep.kernel import layout
from fleetloop.sweep.kernel.coverage import network_acts
from fleetloop.sweep.kernel.hearing import NONE, Changes, changes_of, link_changes
from plant.body import RigidBody

_SOURCES: Final = {
    "fused": layout.FUSED,
    "external": layout.EXTERNAL,
    "odometry": layout.ODOMETRY,
}
_UNDISTURBED: Final = WheelDisturbance(amplitude_wheel_N_m=0.0, rate_rad_s=0.0, phase_rad=0.0)
_P = TypeVar("_P", bound=Parameters)
Numbers = tuple[float, ...]
Records = NDArray[np.void]
Curves = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


class Case(NamedTuple):
    """What `loop.simulate` is given of one case."""

    cases: Records
    robots: Records
    states: Records
    edges: Records
    changes: NDArray[np.int64]
    leader_m_s: NDArray[np.float64]
    curves: Curves
    heard: dict[str, dict[str, Changes | None]]
    """By robot and in-neighbour: the share that counts; None: always the newest."""


def lowered(scenario: Scenario, ticks: Schedule) -> Case:
    """A scenario of which `coverage.lacks` says nothing, as numbers; `ticks` are its schedule."""
    graph = _shared_graph(scenario)
    curves = _Splines()
    centre_kind, centre = _centre(scenario.path, curves)
    robots, states = [], []
    edges = _Edges(scenario, ticks, graph)
    for number, robot in enumerate(scenario.robot):
        heard = edges.to(robot.name)
        body, choice = _body_of(scenario, robot), scenario.control_of(robot)
        drives = _drives(_changed(scenario.mounting, robot.mounting))
        offset_kind, place, knots = _offset(scenario.path, robot.offset, curves)
        disturbed, waves = _waves(robot.disturbance or scenario.disturbance, number + 1)
        limits, limit = _host_limits(scenario.host, ticks.period_s)
        law, of_law = _law(choice.parameters, _wheels(body), ticks.period_ns)
        robots.append(
            (
                *(law, limits, disturbed, heard.leader, heard.link),
                *(heard.first_edge, heard.last_edge, offset_kind, *knots),
                *(*of_law, *limit, *place),
                *(*_localiser(body), *drives, *_body(body), *waves),
            )
        )
        states.append(_start(robot, scenario.coordination, choice.parameters, drives))
    case = _case(scenario, ticks, centre_kind, centre, curves)
    return Case(
        layout.records(layout.CASE, [case]),
        layout.records(layout.ROBOT, robots),
        layout.records(layout.STATE, states),
        *edges.arrays(),
        _leader(scenario.leader, ticks.period_ns, ticks.ticks),
        curves.arrays(),
        edges.heard,
    )


def _case(
    scenario: Scenario, ticks: Schedule, kind: int, centre: Numbers, curves: "_Splines"
) -> tuple[Any, ...]:
    coordination, reach = scenario.coordination, scenario.reach
    return (
        *(ticks.ticks, ticks.period_ns, ticks.share_every, ticks.localise_every),
        *(ticks.pose_delay_ticks, substeps(scenario.clock, ticks.period_ns)),
        ticks.countdown_ticks * ticks.period_ns,
        *(round(scenario.drive_choice.heartbeat_period_s * 1e9), scenario.host.rearm),
        _SOURCES[scenario.localisation.source],
        coordination.compensation == "extrapolate",
        *(kind, curves.closed, curves.centre_knots),
        *(ticks.period_s, 0.5 * ticks.period_s, coordination.p, coordination.q),
        *(coordination.age_limit_s, coordination.silence_limit_s),
        *(reach.s_min_m, reach.s_max_m, reach.v_min_m_s, reach.v_max_m_s),
        *(reach.v_min_m_s - reach.v_margin_m_s, reach.v_max_m_s + reach.v_margin_m_s),
        *centre,
    )


def _start(
    robot: sections.Robot, coordination: sections.Coordination, gains: Any, drives: Numbers
) -> tuple[float, ...]:
    """The state of a robot at tick 0, after a countdown in which its drives were armed."""
    pose = robot.pose
    where = pose.x_m, pose.y_m, pose.theta_rad
    return (
        *(0, 0, 0, 0, 0, nan, nan, nan, nan),
        *(*where, robot.v_m_s, robot.omega_rad_s, 0.0, 0.0),
        *(
            0.0 * drives[0],
            0.0 * drives[1],
            0.0,
            0.0,
        ),  # torque 0 was sent last: -0 to a mirror image
        *(0.0, 0.0, nan, nan, 0.0, 0.0, 0.0),
        *anchored(*where, (0.0, 0.0, 0.0)),
        *(coordination.v_hat_0, coordination.mu_0, robot.s_0, *((nan,) * 17)),
        *(nan, nan, nan, *gains.theta_hat_0, gains.kappa_hat_0),
        *(0.0, 0.0),
    )


def _body_of(scenario: Scenario, robot: sections.Robot) -> sections.Body:
    """As `Scenario.body_of`."""
    body: sections.Body = _changed(scenario.robot_types.get(robot.type, _BODY), robot.body)
    return body


_BODY: Final = sections.Body()


@lru_cache(maxsize=4096)
def _changed(section: _P, changes: Parameters) -> _P:
    """As `configs.parameters.changed`, once for all cases."""
    return changed(section, changes)


# --- the graph and the leader ---------------------------------------------------------------------


def _shared_graph(scenario: Scenario) -> Graph:
    """The graph of a scenario, computed once for all that have it."""
    made: Graph | None = scenario.__dict__.get("topology")
    if made is None:
        key = (
            *(scenario.graph, scenario.names, scenario.clock.control_period_s),
            *(scenario.duration_s, scenario.ends_at_s),
        )
        made = _GRAPHS.get(key)
        if made is None:
            if len(_GRAPHS) >= _MOST_GRAPHS:
                _GRAPHS.clear()
            made = _GRAPHS[key] = scenario.topology
        scenario.__dict__["topology"] = made
    return made


class _Heard(NamedTuple):
    """What one robot hears."""

    leader: int
    link: int
    """The number of its leader link, −1 if it has none."""
    first_edge: int
    last_edge: int


class _Edges:
    """All edges, those to each robot behind each other, then its leader link; and their changes."""

    def __init__(self, scenario: Scenario, ticks: Schedule, graph: Graph) -> None:
        self._scenario, self._ticks, self._graph = scenario, ticks, graph
        self._emulated = network_acts(scenario.network)
        self._numbers = {name: number for number, name in enumerate(scenario.names)}
        self._rows: list[tuple[float, int, int, int, int, int]] = []
        self._changes: Changes = []
        self.heard: dict[str, dict[str, Changes | None]] = {name: {} for name in scenario.names}

    def to(self, robot: str) -> _Heard:
        """Put down the edges to a robot."""
        models = {}
        if self._emulated:
            models = {model.source: model for model in channels(self._scenario, robot)}
        first = len(self._rows)
        for edge in self._graph.hears[robot]:
            model = models.get(edge.speaker)
            steady = model is None and edge.windows is None
            changes = [] if steady else self._changes_of(edge, model)
            self.heard[robot][edge.speaker] = None if steady else changes
            self._add(edge, self._numbers[edge.speaker], changes, steady=steady)
        last, link = len(self._rows), self._graph.links.get(robot)
        if link is None:
            return _Heard(layout.OWN_ESTIMATE if models else layout.UNHEARD, -1, first, last)
        self._add(link, -1, link_changes(link, self._ticks.ticks), steady=False)
        return _Heard(layout.HEARD, last, first, last)

    def _changes_of(self, edge: InEdge, model: ChannelModel | None) -> Changes:
        return changes_of(edge, model, self._ticks, self._scenario.coordination)

    def _add(
        self, edge: InEdge, speaker: int, changes: Sequence[tuple[int, int]], *, steady: bool
    ) -> None:
        first = len(self._changes)
        self._changes += changes
        self._rows.append((edge.weight, speaker, steady, first, len(self._changes), NONE))

    def arrays(self) -> tuple[Records, NDArray[np.int64]]:
        """For the loop."""
        changes = np.array(self._changes, np.int64).reshape(-1, 2)
        return layout.records(layout.EDGE, self._rows), changes


_MOST_GRAPHS: Final = 4096
_GRAPHS: Final[dict[tuple[Any, ...], Graph]] = {}


@lru_cache(maxsize=64)
def _leader(leader: sections.Leader, period_ns: int, ticks: int) -> NDArray[np.float64]:
    """v_r at every tick."""
    changes = speed_changes(leader)
    if len(changes) == 1:
        return np.full(ticks, changes[0].speed_m_s)
    return np.array([speed_at(changes, tick * period_ns) for tick in range(ticks)])


# --- the law --------------------------------------------------------------------------------------


@lru_cache(maxsize=4096)
def _law(gains: Parameters, wheels: Wheels, period_ns: int) -> tuple[int, Numbers]:
    if not isinstance(gains, AdaptiveDscGains):
        raise TypeError(f"{type(gains).__name__} are gains of another law")
    robust = isinstance(gains, AdaptiveDscRobustGains)
    period_s = period_ns * 1e-9
    rates_1, rates_2 = adaptation_rates(gains, period_s)
    numbers = [
        *(number for part in law_constants(gains, wheels, period_s) for number in part),
        *(*rates_1, *rates_2, *Projection.of(gains.sigma_max, gains.sigma_margin)),
    ]
    if isinstance(gains, AdaptiveDscRobustGains):
        numbers += [gains.v_bar_limit_m_s, gains.torque_limit_wheel_N_m]
    else:
        numbers += [inf, inf]
    return layout.ROBUST if robust else layout.PAPER, tuple(numbers)


def _host_limits(host: Any, period_s: float) -> tuple[bool, Numbers]:
    limit, slew = host.torque_limit_wheel_N_m, host.torque_slew_limit_wheel_N_m_s
    limit = inf if limit is None else limit
    slew = inf if slew is None else slew
    return limit < inf or slew < inf, (limit, slew * period_s)


# --- the robot ------------------------------------------------------------------------------------


def _wheels(body: sections.Body) -> Wheels:
    return Wheels(body.wheel_radius_m, body.half_track_m)


def _localiser(body: sections.Body) -> Numbers:
    half = 0.5 * body.wheel_radius_m
    return half, half / body.half_track_m


@lru_cache(maxsize=1024)
def _drives(mounting: sections.Mounting) -> Numbers:
    ratio = mounting.gear_ratio
    right, left = mounting.right_sign, mounting.left_sign
    to_shaft_right, to_wheel_right = torque_factors(right, ratio)
    to_shaft_left, to_wheel_left = torque_factors(left, ratio)
    return (
        *(to_shaft_right, to_shaft_left, to_wheel_right, to_wheel_left),
        *(wheel_rad_per_shaft_rev(right, ratio), wheel_rad_per_shaft_rev(left, ratio)),
        *(right * ratio, left * ratio),
    )


@lru_cache(maxsize=4096)
def _body(body: sections.Body) -> Numbers:
    rigid = RigidBody(body, _UNDISTURBED)
    return *rigid.rolling, rigid.b, rigid.inv_right, rigid.inv_left, rigid.fastest_m_s


@lru_cache(maxsize=4096)
def _waves(disturbance: sections.Disturbance, number: int) -> tuple[bool, Numbers]:
    made = extended(WheelDisturbance, disturbance, phase_rad=float(number))
    rigid = RigidBody(sections.Body(), made)
    return rigid.disturbed, rigid.disturbs


# --- the path -------------------------------------------------------------------------------------


class _Splines:
    """Knots and coefficients of all splines of a case, behind each other; the centre's first."""

    def __init__(self) -> None:
        self._knots: list[float] = []
        self._first: list[Sequence[float]] = []
        self._second: list[Sequence[float]] = []
        self._places: dict[VaryingOffset, tuple[int, int]] = {}
        self.closed, self.centre_knots = False, 0

    def centre(self, spline: SplinePath) -> None:
        """Put down the centre's path, before any offset."""
        self._add(spline.knots_m, spline.x_coefficients, spline.y_coefficients)
        self.closed, self.centre_knots = spline.closed, len(spline.knots_m)

    def place(self, spline: VaryingOffset) -> tuple[int, int]:
        """Put down an offset; its first knot, and the one behind its last."""
        if spline not in self._places:
            start = len(self._knots)
            self._add(spline.knots_m, spline.ahead_coefficients, spline.left_coefficients)
            self._places[spline] = start, len(self._knots)
        return self._places[spline]

    def _add(
        self, knots: Sequence[float], first: Sequence[Numbers], second: Sequence[Numbers]
    ) -> None:
        self._knots += knots
        nothing = (0.0,) * 6  # behind the last knot
        self._first += [*first, nothing]
        self._second += [*second, nothing]

    def arrays(self) -> Curves:
        """For the loop."""
        if not self._knots:
            return _NO_CURVES
        return np.array(self._knots), np.array(self._first), np.array(self._second)


_NO_CURVES: Final[Curves] = (np.zeros(0), np.zeros((0, 6)), np.zeros((0, 6)))


def _centre(shape: paths.PathShape, curves: _Splines) -> tuple[int, Numbers]:
    """The kind of the centre's path, and the five numbers of its jets."""
    path = reference_path(shape)
    match path:
        case paths.Cosine():
            numbers = (*path.start_m, path.amplitude_m, path.wavenumber_rad_m, 0.0)
            return layout.COSINE, numbers
        case paths.Line():
            return layout.LINE, (*path.start_m, *line_tangent(path), 0.0)
        case paths.Circle():
            rate = circle_rate(path)
            start = path.start_angle_rad / rate
            return layout.CIRCLE, (*path.centre_m, path.radius_m, rate, start)
        case paths.FigureEight():
            length = path.half_length_m
            numbers = (*path.centre_m, length, path.half_width_m, 1.0 / length)
            return layout.FIGURE_EIGHT, numbers
        case SplinePath():
            curves.centre(path)
            return layout.SPLINE, (0.0,) * 5
        case _:
            raise TypeError(f"{path} is a shape that the kernel doesn't know")


def _offset(
    path: paths.PathShape, offset: paths.Offset, curves: _Splines
) -> tuple[int, Numbers, tuple[int, int]]:
    """The kind of an offset, the six numbers of its place, and the knots of one that varies."""
    nothing = (0.0,) * 4
    match offset:
        case paths.World() if isinstance(path, paths.Cosine):
            return layout.WORLD, cosine_numbers(path, offset), (0, 0)
        case paths.World():
            return layout.WORLD, (offset.x_m, offset.y_m, *nothing), (0, 0)
        case paths.Structure():
            return layout.STRUCTURE, (offset.ahead_m, offset.left_m, *nothing), (0, 0)
        case paths.Varying():
            return layout.VARYING, (0.0,) * 6, curves.place(_varying(offset))
        case _:
            raise TypeError(f"{offset} is an offset that the kernel doesn't know")


@lru_cache(maxsize=64)
def _varying(offset: paths.Varying) -> VaryingOffset:
    made = formation_offset(offset)
    if not isinstance(made, VaryingOffset):
        raise TypeError(f"{offset} doesn't vary")
    return made
