"""The sections of a scenario file as types: closed, frozen, every key with its unit in its name.

Defaults are the paper's (section 4), and where it is silent those that its numbers were checked
with. What relates sections to each other is checked in `configs.checks`.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from annotated_types import Ge, Gt, Le, Len

from configs import patterns
from configs.choices import Changes, Chooser
from configs.drives import DEFAULT, DRIVES, Drive
from configs.netem import EdgeEffects, Effects
from configs.parameters import (
    MOST_S,
    Finite,
    Name,
    Node,
    NotNegative,
    Parameters,
    Pattern,
    Positive,
    Seconds,
    SecondsOrZero,
    changes_of,
    parameter,
)
from configs.paths import AT_CENTRE, Offset
from configs.plugins import LAWS, Choice, Kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock(Parameters):
    """Time of a run: lockstep or real time, periods and deadlines."""

    mode: Literal["lockstep", "realtime"] = parameter(
        "lockstep", "the plant owns time, or all processes keep the wall clock"
    )
    control_period_s: Seconds = parameter(0.001, "one tick: sense, decide, act")
    share_period_s: Seconds = parameter(0.02, "path variables go to the out-neighbours")
    localisation_period_s: Seconds = parameter(0.01, "poses go to the robots")
    plant_step_s: Annotated[float, Ge(1e-6), Le(MOST_S)] = parameter(
        0.001, "longest integration step of the plant"
    )
    countdown_s: SecondsOrZero = parameter(0.25, "for arming the drives, before t = 0")
    tick_deadline_s: Seconds | None = parameter(
        None,
        "longest wait within a tick, wall clock; if not given 2 s, or 20 ms for each robot if that"
        " is more",
    )
    on_late: Literal["abort", "hold", "drop"] = parameter(
        "abort",
        "in lockstep, of a controller that has gone or doesn't answer within that: abort: the run"
        " ends; hold: the others go on until it answers again; drop: the others go on without it",
    )
    start_deadline_s: Seconds | None = parameter(
        None,
        "longest wait for all processes to be ready; if not given 20 s, or 0.5 s for each"
        " robot if that is more",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Body(Parameters):
    """Physical parameters, equations (2)-(4); the defaults are the paper's EtsRo robot."""

    wheel_radius_m: Positive = parameter(0.04, "r")
    half_track_m: Positive = parameter(0.1, "b, half the distance of the wheels")
    com_offset_m: Finite = parameter(0.02, "a, from the axle ahead to the centre of mass")
    body_mass_kg: Positive = parameter(2.3, "m_c")
    wheel_mass_kg: NotNegative = parameter(0.28, "m_w, with its motor")
    body_inertia_kg_m2: Positive = parameter(
        0.01, "I_c, about the vertical axis through the centre of mass"
    )
    wheel_axle_inertia_kg_m2: NotNegative = parameter(
        0.0056, "I_w, of a wheel with its motor about the axle"
    )
    wheel_diameter_inertia_kg_m2: NotNegative = parameter(
        0.002, "I_m, of a wheel with its motor about a diameter"
    )
    damping_right_wheel_N_m_s: NotNegative = parameter(0.02, "d_11")
    damping_left_wheel_N_m_s: NotNegative = parameter(0.02, "d_22")
    wheels_in_mass: Literal[1, 2] = parameter(
        1, "m = m_c + n m_w: 1 as the paper prints it, 2 physically"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting(Parameters):
    """How the drives sit on the wheels: positive torque at a shaft turns its wheel `sign` forward.

    The drives' own values (limits, encoder) are the motor shaft's; all others are the wheels'.
    """

    right_sign: Literal[1, -1] = 1
    left_sign: Literal[1, -1] = parameter(1, "-1: a drive mounted as a mirror image")
    gear_ratio: Annotated[float, Ge(1e-6), Le(1e6)] = parameter(
        1.0, "motor revolutions per wheel revolution"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance(Parameters):
    """Δ(t) = amplitude [sin(rate t + i), cos(rate t + i)] on the wheels of robot number i."""

    amplitude_wheel_N_m: NotNegative = 0.0
    rate_rad_s: Finite = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose(Parameters):
    """Where a robot starts; θ counter-clockwise from world x."""

    x_m: Finite
    y_m: Finite
    theta_rad: Finite = 0.0


LAW = Chooser(Kind.LAW, "law", LAWS, "adaptive_dsc")
Control = Annotated[Choice, LAW]
"""The law and its gains, in one table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Coordination(Parameters):
    """Equations (38), (40), (45)."""

    p: Positive = parameter(2.0, "(45), of mu [1/s]")
    q: Positive = parameter(1.0, "(45), of the differences of s [1/s²]")
    v_hat_0: Finite = parameter(0.0, "(38), the first estimate of v_r [m/s]")
    mu_0: Finite = parameter(0.0, "(40), at the start [m/s]")
    compensation: Literal["extrapolate", "hold", "both"] = parameter(
        "extrapolate",
        "of the age of a neighbour's s: s + v_r_hat * age; as received; or compared with the"
        " robot's own value of that time",
    )
    age_limit_s: Seconds = parameter(2.0, "a neighbour's value is carried on this far")
    silence_limit_s: Seconds = parameter(2.0, "then a silent neighbour stops counting")
    ahead_limit_s: Seconds = parameter(
        0.5, "in real time, a neighbour dated further ahead isn't believed"
    )


if TYPE_CHECKING:

    @dataclass(frozen=True, slots=True, kw_only=True)
    class BodyChanges(Parameters):
        """Keys of `Body`, none required."""

    @dataclass(frozen=True, slots=True, kw_only=True)
    class MountingChanges(Parameters):
        """Keys of `Mounting`, none required."""
else:
    BodyChanges = changes_of("BodyChanges", Body)
    MountingChanges = changes_of("MountingChanges", Mounting)


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot(Parameters):
    """One robot; what isn't given is its type's."""

    name: Name
    type: Name = "etsro"
    pose: Pose
    v_m_s: Finite = 0.0
    omega_rad_s: Finite = 0.0
    s_0: Finite = parameter(0.0, "path variable at the start [m]")
    offset: Offset = AT_CENTRE
    body: BodyChanges = parameter(BodyChanges(), "parameters that differ from its type's")
    control: Changes = parameter(Changes({}), "law and gains that differ from [control]")
    mounting: MountingChanges = parameter(MountingChanges(), "what differs from [mounting]")
    disturbance: Disturbance | None = None
    joins_at_s: SecondsOrZero = parameter(
        0.0, "until then it stands, armed, and isn't heard; its s begins at its neighbours' mean"
    )
    leaves_at_s: Seconds | None = parameter(None, "from then on it is idle, and isn't heard")
    bus: Name | None = parameter(None, "robots may share one; of its own if not given")
    right_node: Node | None = parameter(None, "[drive] right_node, + 2 per robot on its bus")
    left_node: Node | None = parameter(None, "[drive] left_node, + 2 per robot on its bus")


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedStep(Parameters):
    """From this time on, this speed; or towards it along a ramp."""

    t_s: SecondsOrZero
    speed_m_s: Finite
    ramp_s: SecondsOrZero = parameter(
        0.0,
        "the speed changes linearly over this time, from t_s on, or to the next step; 0: at once",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Leader(Parameters):
    """The virtual leader's speed v_r; at 0 the formation stands."""

    speed_m_s: Finite = 0.6
    steps: Annotated[tuple[SpeedStep, ...], Len(0, 1000)] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Bus(Parameters):
    """The buses, one per robot unless robots name the same."""

    interface: Literal["fleetloop"] = "fleetloop"
    bitrate_bit_s: Annotated[int, Ge(10_000), Le(1_000_000)] = 1_000_000
    timing: Literal["ideal", "wire"] = parameter(
        "ideal", "ideal: frames take no time; wire: bit rate, arbitration and errors"
    )
    txqueuelen: Annotated[int, Ge(1), Le(1000)] = parameter(
        10, "frames that wait at a host before a send fails, as SocketCAN's"
    )
    tx_mailboxes: Annotated[int, Ge(1), Le(32)] = parameter(
        3, "frames that wait in a drive's controller"
    )
    restart_s: SecondsOrZero | None = parameter(
        None, "a host recovers from bus-off this much later; never if not given"
    )
    drive_restart_s: SecondsOrZero | None = parameter(
        None, "the same of a drive; as in the field, never if not given"
    )
    record: tuple[Literal["blf", "log"], ...] = parameter(
        ("blf",), "recordings of every bus in the run's folder: Vector BLF, candump log"
    )
    load_ceiling: Annotated[float, Gt(0), Le(1)] = parameter(
        0.7, "worst-case load above which a check warns of a bus on a wire"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording(Parameters):
    """What a run records beside all signals and the buses."""

    inputs: bool | None = parameter(
        None,
        "all that reaches each controller, for `fleetloop replay`; if not given in real time only,"
        " as a run in lockstep can be repeated",
    )


PROTOCOL = Chooser(Kind.DRIVE, "protocol", DRIVES, DEFAULT, Drive)
DriveChoice = Annotated[Choice, PROTOCOL]
"""The drive protocol and its section, in one table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Localisation(Parameters):
    """Where a controller has its pose from."""

    source: Literal["fused", "external", "odometry"] = parameter(
        "fused", "fixes carried on by wheel odometry, fixes alone, or odometry alone"
    )
    delay_s: Annotated[float, Ge(0), Le(60)] | None = parameter(
        None, "from a pose to its arrival; one control period if not given"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Network(Parameters):
    """The Zenoh router of the run, and the network that is emulated on it."""

    endpoint: Annotated[str, Pattern(patterns.ROUTER)] | None = parameter(
        None, "where the router listens; a free loopback port if not given"
    )
    default: Effects = parameter(Effects(), "of every edge between robots")
    edge: Annotated[tuple[EdgeEffects, ...], Len(0, 1000)] = parameter(
        (), "of some edges, where they differ"
    )
