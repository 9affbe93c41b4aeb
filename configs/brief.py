"""Briefs: the resolved scenario as plain values, cut down to what one process may know.

A scenario file is read and checked once, by `configs.scenario`; every process then gets its brief:
frozen dataclasses of floats, ints, strings and tuples, with all defaults filled in and nothing left
to check. This module imports nothing but the standard library, so a controller process starts in a
fraction of a second, and the pure core (paths, laws, plant) takes its parameters as these types.

An `AgentBrief` holds no plant parameter: the controller knows r and b of its robot (Assumption 2.3)
and learns the rest. Angles are
radians, wheel order is (right, left), times are integer nanoseconds.
"""

from dataclasses import dataclass, field
from math import inf

from configs.reach import Reach

Settings = tuple[tuple[str, str | int | float | bool], ...]
"""Keyword arguments as sorted pairs, so that a brief stays hashable and immutable."""
OURS = "fleetloop"
"""The python-can interface whose buses the plant's process holds itself."""
LEAD_TICKS = 16
"""In lockstep a bus may be this many ticks ahead of the slowest."""


# --- reference paths: Γ_0(s) of equation (1) ------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LinePath:
    """Γ_0(s) = start + s (cos heading, sin heading)."""

    start_x_m: float
    start_y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class CosinePath:
    """A cosine along world x, the shape of the paper's section 4.

    Γ_0(s) = (start_x + s, start_y + amplitude cos(wavenumber s)).
    """

    start_x_m: float
    start_y_m: float
    amplitude_m: float
    wavenumber_rad_m: float


@dataclass(frozen=True, slots=True)
class CirclePath:
    """A circle, s in metres of arc.

    Γ_0(s) = centre + radius (cos φ, sin φ), φ = start_angle ± s / radius; + is counter-clockwise.
    """

    centre_x_m: float
    centre_y_m: float
    radius_m: float
    start_angle_rad: float
    clockwise: bool


@dataclass(frozen=True, slots=True)
class FigureEightPath:
    """The lemniscate of Gerono.

    Γ_0(s) = centre + (half_length sin φ, half_width sin 2φ), φ = s / half_length.
    """

    centre_x_m: float
    centre_y_m: float
    half_length_m: float
    half_width_m: float


@dataclass(frozen=True, slots=True)
class SplinePath:
    """Piecewise quintic polynomials, continuous up to the fourth derivative.

    In segment n, x = Σ_m x_coefficients[n][m] (s − knots[n])^m, same for y. `closed`: s is taken
    modulo the length; else the tangents at both ends go on straight outside the knots.
    """

    knots_m: tuple[float, ...]
    x_coefficients: tuple[tuple[float, ...], ...]
    y_coefficients: tuple[tuple[float, ...], ...]
    closed: bool


ReferencePath = LinePath | CosinePath | CirclePath | FigureEightPath | SplinePath


# --- formation offsets: R(θ_d0(s)) l_i(s) of equation (1) -----------------------------------------


@dataclass(frozen=True, slots=True)
class WorldOffset:
    """R(θ_d0) l_i = (x, y), constant in world axes: the paper's section 4 has (0, o_i)."""

    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class StructureOffset:
    """l_i = (ahead, left), constant in the axes of the virtual structure.

    Those axes turn with the path: `ahead` is along its tangent.
    """

    ahead_m: float
    left_m: float


@dataclass(frozen=True, slots=True)
class VaryingOffset:
    """l_i(s) in the axes of the virtual structure: a quintic spline in s, as in `SplinePath`.

    Constant outside [knots[0], knots[-1]]; its first two derivatives are 0 at both ends.
    """

    knots_m: tuple[float, ...]
    ahead_coefficients: tuple[tuple[float, ...], ...]
    left_coefficients: tuple[tuple[float, ...], ...]


FormationOffset = WorldOffset | StructureOffset | VaryingOffset


# --- the controller -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Wheels:
    """What the controller knows of its robot: r and b (Assumption 2.3)."""

    radius_m: float
    half_track_m: float


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of equations (15)-(36); see `agents.path_following` and `agents.wheel_torque`."""

    k1: float  # [1/s]
    k2: float  # [1/m]
    k3: float  # [1/s]
    k4: float  # [N·m·s/m, N·m·s/rad]
    gamma_1_s: float
    gamma_2_s: float
    gamma_3_s: float
    k5: tuple[float, float, float, float, float, float, float, float]  # diagonal of K_5
    sigma_max: float  # bound σ_M of every element of Θ
    sigma_margin: float  # k of the projection
    eta: float  # [1/s] of (36)
    rho: float
    sgn_width: float  # sgn(e) is tanh(e / sgn_width)
    theta_hat_0: tuple[float, float, float, float, float, float, float, float]
    kappa_hat_0: float
    v_bar_limit_m_s: float  # of the robust law
    torque_limit_wheel_N_m: float  # of the robust law


@dataclass(frozen=True, slots=True)
class Coordination:
    """Equations (38), (40), (45): gains, start values, and how long a silent neighbour counts."""

    p: float  # [1/s]
    q: float  # [1/s²]
    s_0: float
    mu_0: float
    v_hat_0: float
    age_limit_s: float  # a neighbour's value is extrapolated at most this far
    silence_limit_s: float  # after this long a silent neighbour leaves the sums
    ahead_limit_s: float = 0.5  # in real time: who is dated further ahead isn't believed


def when(tick: int, period_ns: int) -> str:
    """A tick in words."""
    return f"tick {tick} (t = {tick * period_ns * 1e-9:.3f} s)"


@dataclass(frozen=True, slots=True)
class Schedule:
    """The ticks of a run.

    Tick k is scenario time k × period; ticks below 0 are the countdown (arming).
    """

    period_ns: int
    ticks: int  # control ticks 0 .. ticks − 1; tick `ticks` closes the run
    countdown_ticks: int  # the run's first tick is −countdown_ticks
    share_every: int  # path states are due at ticks k ≥ 0 with k % share_every == 0
    localise_every: int  # poses are taken at ticks k ≥ 0 with k % localise_every == 0
    pose_delay_ticks: int  # and reach the robots this many ticks later
    tick_deadline_s: float  # how long anybody waits for anybody within one tick [wall s]
    start_deadline_s: float  # how long everybody has to become ready [wall s]
    hello_every_s: float = 0.02  # how often everybody says hello until then [wall s]
    realtime: bool = False  # everybody keeps the wall clock; else the plant owns time
    profile: bool = False  # every process samples where its processor time goes

    @property
    def period_s(self) -> float:
        """The control period h."""
        return self.period_ns * 1e-9

    @property
    def longest_start_s(self) -> float:
        """No run begins later than this after everybody was told so [s]."""
        return self.start_deadline_s + self.countdown_ticks * self.period_s

    def shares(self, tick: int) -> bool:
        """Whether path states are due at this tick."""
        return tick >= 0 and tick % self.share_every == 0

    def localises(self, tick: int) -> bool:
        """Whether the localisation system takes poses at this tick."""
        return tick >= 0 and tick % self.localise_every == 0

    def owes(self, tick: int) -> bool:
        """Whether a pose or path states are due at this tick."""
        return self.shares(tick) or self.localises(tick - self.pose_delay_ticks)

    def when(self, tick: int) -> str:
        """A tick in words."""
        return when(tick, self.period_ns)

    def bus_time_ns(self, tick: int) -> int:
        """Bus time of a tick: nanoseconds since power-up, 0 at the first tick of the countdown."""
        return (tick + self.countdown_ticks) * self.period_ns

    def tick_of(self, bus_time_ns: int) -> int:
        """The tick at or before a bus time."""
        return bus_time_ns // self.period_ns - self.countdown_ticks


@dataclass(frozen=True, slots=True)
class Mounting:
    """How the drives sit on the wheels: wheel angle = sign × shaft angle / gear ratio."""

    right_sign: int = 1  # -1: positive torque at the shaft turns the wheel backwards
    left_sign: int = 1
    gear_ratio: float = 1.0  # motor revolutions per wheel revolution


@dataclass(frozen=True, slots=True)
class DriveLink:
    """How a controller reaches the two drives of its robot."""

    protocol: str  # a key of bridge.drives.DRIVES
    right_node: int
    left_node: int
    encoder_period_ns: int
    velocity_limit_shaft_rev_s: float  # of the motor shaft
    current_limit_A: float
    heartbeat_period_ns: int = 100_000_000
    encoder_age_limit_ns: int = 50_000_000  # older: the drive has dropped out
    heartbeat_age_limit_ns: int = 500_000_000  # older: the drive has dropped out
    mounting: Mounting = Mounting()


@dataclass(frozen=True, slots=True)
class HostLimits:
    """What a controller allows itself, whatever the law asks; at the wheels."""

    pose_age_limit_ns: int  # 0: none
    torque_limit_wheel_N_m: float = inf
    torque_slew_limit_wheel_N_m_s: float = inf
    encoder_mismatch_limit_wheel_rad: float = inf
    pose_mismatch_limit_m: float = inf
    dry_run: bool = False  # everything but torque
    estop_on_exit: bool = False  # else idle
    rearm: bool = False
    rearm_after_ns: int = 500_000_000  # all must have been well for this long
    rearm_attempts: int = 3
    rearm_limit_ns: int = 1_000_000_000  # longest wait for closed loop
    bus_error_limit_ns: int = 0  # 0: an error of the bus ends the controller


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose in the world: x forward, y left, θ counter-clockwise from world x."""

    x_m: float
    y_m: float
    theta_rad: float


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """Files of mutual TLS, in PEM; the certificate's common name is the identity."""

    ca: str
    certificate: str
    private_key: str


LEASE_S = 1.0
"""A peer on another machine that is silent for this long is gone."""
LOCAL_LEASE_S = 3600.0
"""On one machine a peer that is gone closes its connection; one that is silent is stopped, and may
go on (Ctrl-Z and `fg`)."""


@dataclass(frozen=True, slots=True)
class NetworkLink:
    """How one process reaches the router, and as whom."""

    run: str  # the run's name in every key: fleetloop/<run>/...
    endpoint: str  # e.g. tcp/127.0.0.1:40001
    user: str
    password: str = field(repr=False)
    tls: TlsFiles | None = None
    lease_s: float = LEASE_S  # the router waits so long for a word of it


@dataclass(frozen=True, slots=True)
class Outside:
    """Where the router listens for roles on other machines."""

    endpoint: str
    tls: TlsFiles | None


@dataclass(frozen=True, slots=True)
class AgentBrief:
    """Everything that one robot's controller process is told at its start."""

    robot: str
    law: str  # a key of agents.laws.LAWS
    wheels: Wheels
    gains: Gains
    coordination: Coordination
    reach: Reach  # what neighbours can say
    path: ReferencePath
    offset: FormationOffset
    hears: tuple[str, ...]  # in-neighbours, sorted: a_ij = 1
    hears_leader: bool  # h_i = 1
    localisation: str  # "fused" | "external" | "odometry"
    schedule: Schedule
    drives: DriveLink
    host: HostLimits
    phase_ns: int  # in real time, this much after a tick's time the controller acts
    bus: Settings  # keyword arguments of can.Bus, verbatim
    network: NetworkLink
    detached: bool = False  # no launcher is its parent: the run's end is when the launcher's
    # token on the network goes


# --- the plant ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Body:
    """Physical parameters of one robot, equations (2)-(4)."""

    wheel_radius_m: float
    half_track_m: float  # b
    com_offset_m: float  # a
    body_mass_kg: float
    wheel_mass_kg: float
    body_inertia_kg_m2: float  # I_c, about the vertical through the centre of mass
    wheel_axle_inertia_kg_m2: float  # I_w
    wheel_diameter_inertia_kg_m2: float  # I_m
    damping_right_wheel_N_m_s: float  # d_11
    damping_left_wheel_N_m_s: float  # d_22
    wheels_in_mass: int  # m = m_c + n m_w: 1 as printed in the paper, 2 physically


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Δ_i(t) = amplitude [sin(rate t + phase), cos(rate t + phase)] on (right, left) for t ≥ 0."""

    amplitude_wheel_N_m: float
    rate_rad_s: float
    phase_rad: float


@dataclass(frozen=True, slots=True)
class DriveModel:
    """The emulated drive behind each wheel: limits and cyclic messages of an ODrive axis."""

    protocol: str
    torque_constant_N_m_A: float
    current_limit_A: float
    velocity_limit_shaft_rev_s: float
    velocity_gain_shaft_N_m_s_rev: float
    overspeed_ratio: float
    torque_limiters: bool  # False: torque reaches the wheel as commanded (ideal drive)
    heartbeat_period_ns: int
    encoder_period_ns: int
    torques_period_ns: int  # 0: only on request
    watchdog_ns: int  # 0: off
    zero_torque_on_disarm: bool
    serial_number: int  # of the right drive; the left one has the next number
    command_latency_ns: tuple[int, int] = (0, 0)  # from a frame's end until firmware acts on it
    error_period_ns: int = 0  # cyclic messages; 0: only on request
    iq_period_ns: int = 0
    temperature_period_ns: int = 0
    bus_period_ns: int = 0  # voltage and current
    powers_period_ns: int = 0
    firmware: tuple[int, int, int] = (0, 6, 10)
    boot_ns: int = 0  # silent for so long after a reboot
    calibrated: bool = True  # at power-up
    calibration_ns: int = 2_000_000_000  # each of motor and encoder
    estop_blocks_arming: bool = True  # until errors are cleared
    position_gain_1_s: float = 20.0
    velocity_integrator_gain_shaft_N_m_rev: float = 1.0 / 3.0
    velocity_ramp_shaft_rev_s2: float = 1.0
    torque_ramp_shaft_N_m_s: float = 0.01
    input_filter_bandwidth_1_s: float = 2.0
    trajectory_velocity_shaft_rev_s: float = 2.0
    trajectory_accel_shaft_rev_s2: float = 0.5
    trajectory_decel_shaft_rev_s2: float = 0.5
    current_margin_A: float = 8.0  # above the limit in force, then it disarms
    derate_from_C: float = 100.0  # the current limit falls linearly
    derate_to_C: float = 120.0  # to nothing; 5 K above, it disarms
    under_voltage_V: float = 10.0
    over_voltage_V: float = 30.0
    spinout_power_W: float = 10.0  # 0: not detected


@dataclass(frozen=True, slots=True)
class MotorModel:
    """The motor behind a drive, with its power stage: see `plant.motor`."""

    torque_constant_N_m_A: float  # of the motor
    assumed_torque_constant_N_m_A: float  # set in the drive
    current_limit_A: float  # of the power stage
    current_loop_s: float  # time constant
    compute_delay_s: float
    winding_resistance_ohm: float  # heat is R i²
    fet_resistance_ohm: float
    viscous_friction_shaft_N_m_s: float
    coulomb_friction_shaft_N_m: float
    ambient_C: float
    motor_thermal_resistance_K_W: float
    motor_thermal_time_s: float
    fet_thermal_resistance_K_W: float
    fet_thermal_time_s: float
    torque_noise_shaft_N_m: float  # rms, of the drive's estimate
    current_quantum_A: float  # of the drive's measurement; 0: none


@dataclass(frozen=True, slots=True)
class EncoderModel:
    """The encoder on a motor's shaft, and the drive's estimator behind it: see `plant.encoder`."""

    counts_per_shaft_rev: int
    index: bool
    noise_counts: float  # rms
    pll_bandwidth_rad_s: float
    pll_rate_Hz: float


@dataclass(frozen=True, slots=True)
class SupplyModel:
    """The source that feeds both drives of a robot: see `plant.supply`."""

    voltage_V: float  # open circuit
    resistance_ohm: float
    absorbs: bool  # False: braking charges the bus capacitor instead
    capacitance_F: float
    standby_W: float  # of each drive


@dataclass(frozen=True, slots=True)
class PowertrainModel:
    """What lies between a robot's drives and its wheels."""

    motor: MotorModel
    encoder: EncoderModel
    supply: SupplyModel
    seed: int  # of the robot's noise


@dataclass(frozen=True, slots=True)
class WireModel:
    """How a bus is emulated that has a bit rate: see `bridge.wire.wire`."""

    bitrate_bit_s: int
    txqueuelen: int  # frames in a host's transmit queue
    tx_mailboxes: int  # frames in a drive's controller
    restart_ns: int | None  # a host starts to recover from bus-off this much later; None: never
    drive_restart_ns: int | None


@dataclass(frozen=True, slots=True)
class RobotBrief:
    """One robot as the plant sees it."""

    robot: str
    bus: str
    body: Body
    disturbance: Disturbance
    drive: DriveModel
    powertrain: PowertrainModel | None  # None: ideal motors and encoders
    right_node: int
    left_node: int
    pose: Pose
    v_m_s: float
    omega_rad_s: float
    mounting: Mounting = Mounting()


@dataclass(frozen=True, slots=True)
class PlantBrief:
    """Everything that the plant process is told at its start."""

    robots: tuple[RobotBrief, ...]
    schedule: Schedule
    substeps: int  # RK4 steps per control period
    speed: float  # real-time factor that the run is held to; 0: as fast as possible
    seed: int
    wire: WireModel | None  # of every bus; None: ideal, frames take no time
    traffic: bool  # tell the recorder what crosses the buses
    network: NetworkLink
    listeners: tuple[tuple[str, int], ...] = ()  # bus, inherited file descriptor of its socket
    attached: tuple[tuple[str, Settings], ...] = ()  # bus, keyword arguments of can.Bus: not ours
    real_robots: tuple[tuple[str, Pose], ...] = ()  # robots that aren't emulated; where they start
    detached: bool = False  # as an agent's
    controllers: tuple[tuple[str, str], ...] = ()  # robot, secret: whom lockstep's buses wait for


@dataclass(frozen=True, slots=True)
class LeaderBrief:
    """The virtual leader.

    V_r(t) as steps (from scenario time [ns], speed [m/s]), in order of time.
    """

    speed_steps: tuple[tuple[int, float], ...]


@dataclass(frozen=True, slots=True)
class RecorderBrief:
    """Everything that the recorder is told at its start."""

    path: str  # of the record
    robots: tuple[str, ...]
    buses: tuple[str, ...]  # whose traffic is recorded
    bus_formats: tuple[str, ...]  # "blf", "log"
    scenario_toml: str
    period_ns: int
    start_deadline_s: float
    hello_every_s: float
    network: NetworkLink
    runtime_folder: str  # holds the buses' sockets; goes when the launcher was killed
    ticks: int  # of the run: nobody has rows of later ones
    last_frame_ns: int  # bus time after which no frame ends
