"""The sections of a scenario file as types: closed, frozen, every key with its unit in its name.

Defaults are the paper's (section 4), and where it is silent those that its numbers were checked
with. What relates sections to each other is checked in `configs.scenario`.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal, Optional

from pydantic import BaseModel, ConfigDict, Field, create_model

from configs import patterns

MOST = 1e12
"""Beyond every quantity of a robot, and far enough from where products of floats are infinite."""
MOST_S = 1e9
"""Thirty years: all sums of times fit into 64 bits of nanoseconds."""
MOST_INTEGER = (1 << 53) - 1
"""What every reader of TOML and JSON takes exactly."""

Finite = Annotated[float, Field(ge=-MOST, le=MOST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=MOST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=MOST, allow_inf_nan=False)]
Seconds = Annotated[float, Field(gt=0, le=MOST_S, allow_inf_nan=False)]
SecondsOrZero = Annotated[float, Field(ge=0, le=MOST_S, allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0, le=MOST_INTEGER)]
Name = Annotated[str, Field(pattern=patterns.NAME, max_length=32)]
Node = Annotated[int, Field(ge=0, le=62)]
Point = Annotated[tuple[Finite, Finite], Field(strict=False)]
Eight = Annotated[
    tuple[Finite, Finite, Finite, Finite, Finite, Finite, Finite, Finite], Field(strict=False)
]


class Section(BaseModel):
    """One table of the file: unknown keys are errors, values don't change type or later."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Clock(Section):
    """Who waits for whom, and how often what happens."""

    mode: Literal["lockstep", "realtime"] = Field(
        "lockstep", description="the plant owns time, or everybody keeps the wall clock's"
    )
    control_period_s: Seconds = Field(0.001, description="one tick: sense, decide, act")
    share_period_s: Seconds = Field(0.02, description="path variables go to the out-neighbours")
    localisation_period_s: Seconds = Field(0.01, description="poses go to the robots")
    plant_step_s: Annotated[float, Field(ge=1e-6, le=MOST_S, allow_inf_nan=False)] = Field(
        0.001, description="longest integration step of the plant"
    )
    countdown_s: SecondsOrZero = Field(0.25, description="for arming the drives, before t = 0")
    tick_deadline_s: Seconds = Field(2.0, description="longest wait within a tick, wall clock")
    start_deadline_s: Seconds | None = Field(
        None,
        description="longest wait for everybody to be ready; if not given 20 s, or 0.5 s for each"
        " robot if that is more",
    )
    on_late: Literal["abort"] = Field("abort", description="what happens when somebody is late")


class Line(Section):
    """A straight line."""

    kind: Literal["line"]
    start_m: Point = (0.0, 0.0)
    heading_rad: Finite = 0.0


class Cosine(Section):
    """x = start + s, y = start + amplitude cos(wavenumber s)."""

    kind: Literal["cosine"]
    start_m: Point = (0.0, 0.0)
    amplitude_m: Finite = 1.0
    wavenumber_rad_m: Positive = 1.0


class Circle(Section):
    """A circle, s in metres of arc."""

    kind: Literal["circle"]
    centre_m: Point = (0.0, 0.0)
    radius_m: Positive
    start_angle_rad: Finite = 0.0
    clockwise: bool = False


class FigureEight(Section):
    """The lemniscate of Gerono."""

    kind: Literal["figure_eight"]
    centre_m: Point = (0.0, 0.0)
    half_length_m: Positive
    half_width_m: Positive


class Spline(Section):
    """A quintic spline through points; s is the length of the polygon through them."""

    kind: Literal["spline"]
    points_m: Annotated[tuple[Point, ...], Field(min_length=2, max_length=200, strict=False)]
    closed: bool = False


PathShape = Annotated[Line | Cosine | Circle | FigureEight | Spline, Field(discriminator="kind")]


class World(Section):
    """Offset fixed in world axes."""

    kind: Literal["world"]
    x_m: Finite = 0.0
    y_m: Finite = 0.0


class Structure(Section):
    """Offset fixed in the axes of the formation, which turn with the path."""

    kind: Literal["structure"]
    ahead_m: Finite = 0.0
    left_m: Finite = 0.0


class Knot(Section):
    """Offset at one place of the path."""

    s_m: Finite
    ahead_m: Finite
    left_m: Finite


class Varying(Section):
    """Offset that changes along the path, smoothly through these knots and constant outside."""

    kind: Literal["varying"]
    knots: Annotated[tuple[Knot, ...], Field(min_length=2, max_length=200, strict=False)]


Offset = Annotated[World | Structure | Varying, Field(discriminator="kind")]


class Body(Section):
    """Physical parameters, equations (2)-(4); the defaults are the paper's EtsRo robot."""

    wheel_radius_m: Positive = 0.04
    half_track_m: Positive = 0.1
    com_offset_m: Finite = 0.02
    body_mass_kg: Positive = 2.3
    wheel_mass_kg: NotNegative = 0.28
    body_inertia_kg_m2: Positive = 0.01
    wheel_axle_inertia_kg_m2: NotNegative = 0.0056
    wheel_diameter_inertia_kg_m2: NotNegative = 0.002
    damping_right_wheel_N_m_s: NotNegative = 0.02
    damping_left_wheel_N_m_s: NotNegative = 0.02
    wheels_in_mass: Literal[1, 2] = Field(
        1, description="m = m_c + n m_w: 1 as the paper prints it, 2 physically"
    )


class Mounting(Section):
    """How the drives sit on the wheels: positive torque at a shaft turns its wheel `sign` forward.

    The drives' own values (limits, encoder) are the motor shaft's; all others are the wheels'.
    """

    right_sign: Literal[1, -1] = 1
    left_sign: Literal[1, -1] = Field(1, description="-1: a drive mounted as a mirror image")
    gear_ratio: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False)] = Field(
        1.0, description="motor revolutions per wheel revolution"
    )


class Disturbance(Section):
    """Δ(t) = amplitude [sin(rate t + i), cos(rate t + i)] on the wheels of robot number i."""

    amplitude_wheel_N_m: NotNegative = 0.0
    rate_rad_s: Finite = 0.5


class Pose(Section):
    """Where a robot starts; θ counter-clockwise from world x."""

    x_m: Finite
    y_m: Finite
    theta_rad: Finite = 0.0


class Control(Section):
    """The law and its gains, equations (15)-(36)."""

    law: Literal["adaptive_dsc", "adaptive_dsc_robust"] = Field(
        "adaptive_dsc", description="the paper's law, or the one for real rates and drives"
    )
    k1: Positive = 2.0
    k2: Positive = 3.0
    k3: Positive = 1.5
    k4: Positive = 3.0
    gamma_1_s: Positive = 0.01
    gamma_2_s: Seconds = 0.01
    gamma_3_s: Seconds = 0.01
    k5: Eight = (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1)
    sigma_max: Positive = Field(1.0, description="bound of every element of Θ")
    sigma_margin: Positive = Field(0.1, description="the projection's k")
    eta: NotNegative = Field(0.001, description="(36) [1/s]")
    rho: Positive = 1.0
    sgn_width: Positive = Field(0.001, description="sgn(e) is tanh(e / sgn_width)")
    theta_hat_0: Eight = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    kappa_hat_0: NotNegative = 0.0
    v_bar_limit_m_s: Positive = Field(2.0, description="approach speed of the robust law")
    torque_limit_wheel_N_m: Positive = Field(2.0, description="per wheel, of the robust law")


class CoordinationSection(Section):
    """Equations (38), (40), (45)."""

    p: Positive = 2.0
    q: Positive = 1.0
    v_hat_0: Finite = 0.0
    mu_0: Finite = 0.0
    age_limit_s: Seconds = Field(2.0, description="a neighbour's value is carried on this far")
    silence_limit_s: Seconds = Field(2.0, description="then a silent neighbour stops counting")
    ahead_limit_s: Seconds = Field(
        0.5, description="in real time, a neighbour dated further ahead isn't believed"
    )


def _changes(name: str, model: type[Section]) -> type[Section]:
    """The same keys as `model`, none of them required: what a robot may say differently."""
    fields: dict[str, Any] = {
        key: (Optional[field.rebuild_annotation()], None)  # noqa: UP045 - built at run time
        for key, field in model.model_fields.items()
    }
    return create_model(name, __base__=Section, __doc__=model.__doc__, **fields)


if TYPE_CHECKING:

    class BodyChanges(Section):
        """Keys of `Body`, none required."""

    class ControlChanges(Section):
        """Keys of `Control`, none required."""

    class MountingChanges(Section):
        """Keys of `Mounting`, none required."""
else:
    BodyChanges = _changes("BodyChanges", Body)
    ControlChanges = _changes("ControlChanges", Control)
    MountingChanges = _changes("MountingChanges", Mounting)


class Robot(Section):
    """One robot; what isn't said is its type's."""

    name: Name
    type: Name = "etsro"
    pose: Pose
    v_m_s: Finite = 0.0
    omega_rad_s: Finite = 0.0
    s_0: Finite = 0.0
    offset: Offset = World(kind="world")
    body: BodyChanges = Field(BodyChanges(), description="parameters that differ from its type's")
    control: ControlChanges = Field(
        ControlChanges(), description="gains that differ from [control]"
    )
    mounting: MountingChanges = Field(MountingChanges(), description="what differs from [mounting]")
    disturbance: Disturbance | None = None
    bus: Name | None = Field(None, description="robots may share one; of its own if not given")
    right_node: Node | None = Field(
        None, description="[drive] right_node, + 2 per robot on its bus"
    )
    left_node: Node | None = Field(None, description="[drive] left_node, + 2 per robot on its bus")


class GraphSection(Section):
    """Who hears whom: "r1 -> r2" means r2 hears r1 (a_21 = 1)."""

    edges: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    generator: Literal["chain", "ring", "tree", "star", "complete", "random"] | None = Field(
        None, description="a named shape over the robots in their order, instead of edges"
    )
    max_in_degree: Annotated[int, Field(ge=1, le=256)] = Field(2, description="of the random graph")
    seed: Seed = Field(1, description="of the random graph")
    leader: Annotated[tuple[str, ...], Field(strict=False)] | None = Field(
        None, description="robots that hear the virtual leader; the first one if not given"
    )


class SpeedStep(Section):
    """From this time on, this speed."""

    t_s: SecondsOrZero
    speed_m_s: Finite


class Leader(Section):
    """The virtual leader's speed v_r."""

    speed_m_s: Finite = 0.6
    steps: Annotated[tuple[SpeedStep, ...], Field(max_length=1000, strict=False)] = ()


class Bus(Section):
    """The buses, one per robot unless robots name the same."""

    interface: Literal["fleetloop"] = "fleetloop"
    bitrate_bit_s: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    timing: Literal["ideal", "wire"] = Field(
        "ideal", description="ideal: frames take no time; wire: bit rate, arbitration and errors"
    )
    txqueuelen: Annotated[int, Field(ge=1, le=1000)] = Field(
        10, description="frames that wait at a host before a send fails, as SocketCAN's"
    )
    tx_mailboxes: Annotated[int, Field(ge=1, le=32)] = Field(
        3, description="frames that wait in a drive's controller"
    )
    restart_s: SecondsOrZero | None = Field(
        None, description="a host recovers from bus-off this much later; never if not given"
    )
    drive_restart_s: SecondsOrZero | None = Field(
        None, description="the same of a drive; as in the field, never if not given"
    )
    record: Annotated[tuple[Literal["blf", "log"], ...], Field(strict=False)] = Field(
        ("blf",), description="recordings of every bus in the run's folder: Vector BLF, candump log"
    )
    load_ceiling: Annotated[float, Field(gt=0, le=1)] = Field(
        0.7, description="worst-case load above which a check warns of a bus on a wire"
    )


class Drive(Section):
    """The drives, two per robot."""

    protocol: Literal["odrive"] = "odrive"
    preset: Literal["ideal", "limited", "realistic"] = Field(
        "ideal",
        description="ideal: torque as commanded; limited: with the limits below; realistic: these,"
        " and [motor], [encoder], [supply]",
    )
    right_node: Node = 0
    left_node: Node = 1
    heartbeat_period_s: Seconds = 0.1
    encoder_period_s: Seconds | None = Field(
        None,
        description="of encoder frames, whole milliseconds, at most one control period, which it is"
        " if not given; in lockstep on ideal buses they come with the ticks",
    )
    torques_period_s: SecondsOrZero = Field(
        0.0, description="this message and the next five: whole milliseconds; 0: only on request"
    )
    error_period_s: SecondsOrZero = 0.0
    iq_period_s: SecondsOrZero = 0.0
    temperature_period_s: SecondsOrZero = 0.0
    bus_voltage_period_s: SecondsOrZero = 0.0
    powers_period_s: SecondsOrZero = 0.0
    firmware: Annotated[str, Field(pattern=patterns.FIRMWARE)] = Field(
        "0.6.10", description="from 0.6.11 on, writing an endpoint is answered"
    )
    boot_s: SecondsOrZero = Field(0.5, description="silent for so long after a reboot")
    calibrated: bool = Field(True, description="at power-up; else arming needs a calibration")
    calibration_s: Seconds = Field(2.0, description="of the motor, and then of the encoder")
    estop_blocks_arming: bool = Field(True, description="until errors are cleared")
    under_voltage_V: NotNegative = Field(10.0, description="of the bus; below, a drive disarms")
    over_voltage_V: Positive = Field(30.0, description="of the bus; above, a drive disarms")
    derate_from_C: Finite = Field(100.0, description="from here the current limit falls linearly")
    derate_to_C: Finite = Field(120.0, description="to nothing here; 5 K above, a drive disarms")
    spinout_power_W: NotNegative = Field(
        10.0, description="disarms if the motor brakes and takes more than this; 0: it never does"
    )
    watchdog_s: SecondsOrZero = Field(0.1, description="0: off, as drives are delivered")
    command_latency_s: Annotated[tuple[SecondsOrZero, SecondsOrZero], Field(strict=False)] = Field(
        (0.0001, 0.0011),
        description="least and most from the end of a frame until firmware acts on it; preset"
        " realistic on buses with bit timing",
    )
    zero_torque_on_disarm: bool = Field(False, description="False: as in the field")
    torque_constant_N_m_A: Positive = 0.05
    current_limit_A: Positive = 10.0
    velocity_limit_shaft_rev_s: Positive = 10.0
    velocity_gain_shaft_N_m_s_rev: Positive = 1.0 / 6.0
    velocity_integrator_gain_shaft_N_m_rev: NotNegative = 1.0 / 3.0
    position_gain_1_s: NotNegative = 20.0
    overspeed_ratio: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 1.2


class Localisation(Section):
    """Where a controller has its pose from."""

    source: Literal["fused", "external", "odometry"] = Field(
        "fused", description="fixes carried on by wheel odometry, fixes alone, or odometry alone"
    )
    delay_s: Annotated[float, Field(ge=0, le=60, allow_inf_nan=False)] | None = Field(
        None, description="from a pose to its arrival; one control period if not given"
    )


class Network(Section):
    """The Zenoh router of the run."""

    endpoint: Annotated[str, Field(pattern=patterns.ROUTER)] | None = Field(
        None, description="where the router listens; a free loopback port if not given"
    )


class Expect(Section):
    """What has to hold at every tick of a window, or the run ends with exit status 1."""

    signal: str = Field(description="a recorded signal, or s_spread")
    robots: Annotated[tuple[str, ...], Field(strict=False)] | None = Field(
        None, description="all if not given"
    )
    from_s: SecondsOrZero = 0.0
    to_s: Seconds | None = Field(None, description="the end if not given")
    max_abs: NotNegative | None = None
    min: Finite | None = None
    max: Finite | None = None
