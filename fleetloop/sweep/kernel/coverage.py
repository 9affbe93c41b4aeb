"""What the kernel can run: a positive list of keys and of the values that they may have.

A key that stands in no list may only have its default, and a section that stands in none isn't run
at all: what is added to scenarios goes to the in-process reference until the kernel learns it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from functools import cache
from importlib.util import find_spec
from typing import Any, Final

from agents.laws.gains import AdaptiveDscGains, AdaptiveDscRobustGains
from configs import paths, sections
from configs.drives import DEFAULT, Drive
from configs.edges import LEADER
from configs.graph_section import GraphSection
from configs.host import Host
from configs.netem import LOCALISATION, EdgeEffects, Effects
from configs.parameters import Parameters
from configs.plugins import LAWS, Choice
from configs.scenario import Scenario

Reason = Callable[[Any], str]
"""Why a value isn't covered, "" if it is."""


def _any(_: Any) -> str:
    return ""


def _only(wanted: Any, otherwise: str) -> Reason:
    def reason(value: Any) -> str:
        return "" if value == wanted else otherwise

    return reason


def _all_of(names: str) -> dict[str, Reason]:
    return dict.fromkeys(names.split(), _any)


_GAINS: Final = _all_of(
    "k1 k2 k3 k4 gamma_1_s gamma_2_s gamma_3_s k5 sigma_max sigma_margin eta rho sgn_width"
    " theta_hat_0 kappa_hat_0"
)
_SECTIONS: Final[Mapping[str, Reason]] = {
    **_all_of("schema_ name description duration_s until_s seed robot_types expect record"),
    **_all_of("motor encoder supply"),  # only of realistic drives
    **_all_of("clock path leader graph control coordination localisation bus drive_choice"),
    **_all_of("mounting host disturbance network robot"),  # looked at for themselves
    "fault": _only((), "faults"),
}
_DRIVE: Final[Mapping[str, Reason]] = {
    "preset": _only("ideal", "drives with limits or motors of their own"),
    **_all_of("right_node left_node command_latency_s torque_constant_N_m_A current_limit_A"),
    **_all_of("heartbeat_period_s watchdog_s velocity_limit_shaft_rev_s overspeed_ratio"),
    **_all_of("velocity_gain_shaft_N_m_s_rev velocity_integrator_gain_shaft_N_m_rev"),
    **_all_of("position_gain_1_s under_voltage_V over_voltage_V derate_from_C derate_to_C"),
    **_all_of("spinout_power_W firmware boot_s calibration_s estop_blocks_arming"),
}


def _between_robots(edges: tuple[str, ...]) -> str:
    sources = {text.partition("->")[0].strip() for text in edges}
    if others := sources & {LEADER, LOCALISATION}:
        return f"an emulated edge from the {min(others)}"
    return ""


_EFFECTS: Final = {
    **_all_of("delay reordering loss duplication bandwidth_bit_s message_bytes queue_messages"),
    "partitions": _any,
    "distance": _only(None, "losses by distance"),
}
_KEYS: Final[Mapping[type[Parameters], Mapping[str, Reason]]] = {
    sections.Clock: {
        "mode": _only("lockstep", "real time"),
        **_all_of("control_period_s share_period_s localisation_period_s plant_step_s"),
        **_all_of("countdown_s tick_deadline_s on_late start_deadline_s"),
    },
    paths.Line: _all_of("kind start_m heading_rad"),
    paths.Cosine: _all_of("kind start_m amplitude_m wavenumber_rad_m"),
    paths.Circle: _all_of("kind centre_m radius_m start_angle_rad clockwise"),
    paths.FigureEight: _all_of("kind centre_m half_length_m half_width_m"),
    paths.Spline: _all_of("kind points_m closed"),
    paths.World: _all_of("kind x_m y_m"),
    paths.Structure: _all_of("kind ahead_m left_m"),
    paths.Varying: _all_of("kind knots"),
    sections.Leader: _all_of("speed_m_s steps"),
    sections.SpeedStep: _all_of("t_s speed_m_s ramp_s"),
    GraphSection: {
        **_all_of("edges generator adjacency file weights max_in_degree seed leader switch"),
    },
    AdaptiveDscGains: _GAINS,
    AdaptiveDscRobustGains: {**_GAINS, **_all_of("v_bar_limit_m_s torque_limit_wheel_N_m")},
    sections.Coordination: {
        **_all_of("p q v_hat_0 mu_0 age_limit_s silence_limit_s ahead_limit_s"),
        "compensation": lambda value: (
            "" if value in ("extrapolate", "hold") else f'coordination.compensation = "{value}"'
        ),
    },
    sections.Localisation: _all_of("source delay_s"),
    sections.Bus: {
        **_all_of("interface bitrate_bit_s txqueuelen tx_mailboxes restart_s drive_restart_s"),
        **_all_of("record load_ceiling"),
        "timing": _only("ideal", "bit timing of buses"),
    },
    sections.Mounting: _all_of("right_sign left_sign gear_ratio"),
    Host: {
        **_all_of("heartbeat_age_limit_s encoder_age_limit_s pose_age_limit_s"),
        **_all_of("torque_limit_wheel_N_m torque_slew_limit_wheel_N_m_s on_exit"),
        **_all_of("rearm rearm_after_s rearm_attempts rearm_limit_s restarts bus_error_limit_s"),
        "encoder_mismatch_limit_wheel_rad": _only(None, "a check of encoders"),
        "pose_mismatch_limit_m": _only(None, "a check of poses"),
        "dry_run": _only(False, "a dry run"),
    },
    sections.Disturbance: _all_of("amplitude_wheel_N_m rate_rad_s"),
    sections.Network: {
        "endpoint": _any,
        **_all_of("default edge"),  # looked at for themselves
    },
    sections.Robot: {
        **_all_of("name type pose v_m_s omega_rad_s s_0 bus right_node left_node"),
        **_all_of("offset body control mounting disturbance"),  # looked at as they are merged
        "joins_at_s": _only(0.0, "robots that join later"),
        "leaves_at_s": _only(None, "robots that leave"),
    },
    Effects: _EFFECTS,
    EdgeEffects: {**_EFFECTS, "edges": _between_robots},
    sections.Pose: _all_of("x_m y_m theta_rad"),
    sections.Body: _all_of(
        "wheel_radius_m half_track_m com_offset_m body_mass_kg wheel_mass_kg body_inertia_kg_m2"
        " wheel_axle_inertia_kg_m2 wheel_diameter_inertia_kg_m2 damping_right_wheel_N_m_s"
        " damping_left_wheel_N_m_s wheels_in_mass"
    ),
}
"""By the section's type and key."""


def network_acts(network: sections.Network) -> bool:
    """Whether edges between robots are emulated."""
    return network.default != Effects() or bool(network.edge)


def lacks(scenario: Scenario) -> str:
    """Why the kernel can't run a scenario, "" if it can."""
    if not _has_compiler():
        return "numba, which isn't installed: pip install 'fleetloop[sweep]'"
    if _covered and next(_reasons(scenario, _covered[0]), None) is None:
        return ""
    found = next(_reasons(scenario), "")
    if not found:
        _covered[:] = [scenario]
    return found


_covered: Final[list[Scenario]] = []
"""The last scenario of which all was looked at and nothing found: cases share its sections."""


@cache
def _has_compiler() -> bool:
    return find_spec("numba") is not None


_LOOKED_AT: Final = (
    *("clock", "path", "leader", "graph", "coordination", "localisation", "bus", "mounting"),
    *("host", "disturbance", "network"),
)


def _reasons(scenario: Scenario, covered: Scenario | None = None) -> Iterator[str]:
    """Of all sections, or of those that aren't the same objects in a covered scenario."""
    fields_of = type(scenario).model_fields
    differing = {
        name
        for name in fields_of
        if covered is None or getattr(scenario, name) is not getattr(covered, name)
    }
    for name in filter(differing.__contains__, fields_of):
        value = getattr(scenario, name)
        if name in _SECTIONS:
            yield from filter(None, (_SECTIONS[name](value),))
        elif value != fields_of[name].get_default(call_default_factory=True):
            yield f"section [{name}]"
    for name in filter(differing.__contains__, _LOOKED_AT):
        for section in _parts(getattr(scenario, name)):
            yield from _of_section(section)
    if "drive_choice" in differing:
        if scenario.drive_choice.name == DEFAULT:
            yield from filter(None, (_reason_of(scenario.drive_choice.parameters),))
        else:
            yield f"the drive protocol {scenario.drive_choice.name}"
    known = () if covered is None else covered.robot
    yield from _of_robots(scenario, known, anew="control" in differing)
    if "robot_types" in differing:
        for body in scenario.robot_types.values():
            yield from _of_section(body)


def _of_robots(scenario: Scenario, known: Sequence[sections.Robot], *, anew: bool) -> Iterator[str]:
    """Of robots that aren't known; of the others the law, if it is to be looked at anew."""
    there = {id(robot) for robot in known}
    for robot in scenario.robot:
        unknown = id(robot) not in there
        if unknown:
            yield from filter(None, (_reason_of(robot),))
            yield from _of_section(robot.offset)
        if unknown or anew:
            yield from _of_law(scenario.control_of(robot))
        if unknown:
            yield from _of_section(robot.pose)
            yield from _of_section(robot.disturbance or scenario.disturbance)


def _parts(section: object) -> tuple[object, ...]:
    """A section and the tables in it."""
    match section:
        case sections.Leader():
            return section, *section.steps
        case sections.Network():
            return section, section.default, *section.edge
    return (section,)


def _of_law(choice: Choice) -> Iterator[str]:
    if choice.name in LAWS and type(choice.parameters) in (
        AdaptiveDscGains,
        AdaptiveDscRobustGains,
    ):
        yield from _of_section(choice.parameters)
    else:
        yield f"the law {choice.name}"


def _of_section(section: object) -> Iterator[str]:
    if isinstance(section, Choice):
        yield f"the shape {section.name}"
    elif reason := _reason_of(section):
        yield reason


def _reason_of(section: object) -> str:
    kind: Any = type(section)
    looks = _looks_of(kind)
    if looks is None:
        return f"a section of the type {kind.__name__}"
    for name, reason in looks:
        if said := reason(getattr(section, name)):
            return said
    return ""


@cache
def _looks_of(kind: Any) -> tuple[tuple[str, Reason], ...] | None:
    """The keys of a type of section that can't have any value; None: no such section is covered."""
    keys = _DRIVE if issubclass(kind, Drive) else _KEYS.get(kind)
    if keys is None:
        return None
    looks = []
    for field in fields(kind):
        default = field.default
        if default is MISSING and field.default_factory is not MISSING:
            default = field.default_factory()
        unknown = _only(default, f"the key {field.name} of {kind.__name__}")
        looks.append((field.name, keys.get(field.name, unknown)))
    return tuple(look for look in looks if look[1] is not _any)
