"""Briefs: the resolved scenario as plain values, cut down to what one process may know.

A scenario file is read and checked once, by `configs.scenario`; every process then gets its brief:
frozen dataclasses of floats, ints, strings and tuples, with all defaults filled in and nothing left
to check. A section of the file that a process needs whole is in its brief as it is; one that needs
more (nanoseconds, defaults that other sections decide) is extended by a subclass.
No library is imported here, so a controller process starts in a fraction of a second.

An `AgentBrief` holds no plant parameter: the controller knows r and b of its robot (Assumption 2.3)
and learns the rest. Angles are radians, wheels in the order (right, left), times integer
nanoseconds.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from typing import Literal

from configs.connections import NetworkLink, Settings
from configs.curves import FormationOffset, ReferencePath
from configs.edges import InEdge, Windows
from configs.events import when
from configs.faults.absences import Absence
from configs.faults.base import PlannedFault
from configs.host import Host
from configs.leader_speed import SpeedChange
from configs.membership import Membership
from configs.netem import Effects
from configs.parameters import Parameters
from configs.plugins import Choice
from configs.powertrain import Encoder, Motor, Supply
from configs.reach import Reach
from configs.sections import Body, Bus, Coordination, Disturbance, Mounting, Pose
from configs.signals import Signal

OnLate = Literal["abort", "hold", "drop"]
LEAD_TICKS = 16
"""In lockstep a bus may be this many ticks ahead of the slowest."""
ROWS_WITHIN_NS = 40_000_000
"""In this time rows for the record are handed on, so that a viewer sees a run at 25 Hz."""
UNWATCHED_ROWS_WITHIN_NS = 250_000_000
"""In this time where nobody hears them on the network: larger blocks cost the recorder less."""


# --- the controller -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Wheels:
    """What the controller knows of its robot: r and b (Assumption 2.3)."""

    radius_m: float
    half_track_m: float


@dataclass(frozen=True, slots=True)
class Schedule:
    """The ticks of a run.

    Tick k is scenario time k × period; ticks below 0 are the countdown (arming). What is due at a
    tick, and its bus time, is `configs.ticks`.
    """

    period_ns: int
    ticks: int  # control ticks 0 .. ticks − 1; tick `ticks` closes the run
    countdown_ticks: int  # the run's first tick is −countdown_ticks
    share_every: int  # path states are due at ticks k ≥ 0 with k % share_every == 0
    localise_every: int  # poses are taken at ticks k ≥ 0 with k % localise_every == 0
    pose_delay_ticks: int  # and reach the robots this many ticks later
    tick_deadline_s: float  # longest wait for another process within one tick [wall s]
    start_deadline_s: float  # longest wait for all processes to be ready [wall s]
    hello_every_s: float = 0.02  # period of each process's hello until then [wall s]
    realtime: bool = False  # all processes keep the wall clock; else the plant owns time
    on_late: OnLate = "abort"  # in lockstep, of a controller that has gone or doesn't answer
    profile: bool = False  # every process samples where its processor time goes
    status_every_s: float = 0.1  # period of what each process says of itself for people [wall s]
    rows_within_ns: int = ROWS_WITHIN_NS  # a row is handed on so long after it was made [wall ns]

    @property
    def period_s(self) -> float:
        """The control period h."""
        return self.period_ns * 1e-9

    @property
    def longest_start_s(self) -> float:
        """The longest time from the go to tick 0 [s]."""
        return self.start_deadline_s + self.countdown_ticks * self.period_s

    def when(self, tick: int) -> str:
        """A tick in words."""
        return when(tick, self.period_ns)


@dataclass(frozen=True, slots=True)
class DriveLink:
    """Connection of a controller to the two drives of its robot."""

    choice: Choice  # of the protocol, with its section
    limited: bool  # False: drives obey no limits (preset ideal)
    right_node: int
    left_node: int
    encoder_period_ns: int
    mounting: Mounting
    encoder_age_limit_ns: int = 50_000_000  # older: the drive has dropped out
    heartbeat_age_limit_ns: int = 500_000_000  # older: the drive has dropped out

    @property
    def section(self) -> Parameters:
        """Section [drive], of the type that the protocol's row names."""
        return self.choice.parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class HostLimits(Host):
    """Section [host] as a controller obeys it: no limit is an infinite one."""

    torque_limit_wheel_N_m: float = inf
    torque_slew_limit_wheel_N_m_s: float = inf
    encoder_mismatch_limit_wheel_rad: float = inf
    pose_mismatch_limit_m: float = inf
    pose_age_limit_ns: int  # 0: none
    rearm_after_ns: int = 500_000_000
    rearm_limit_ns: int = 1_000_000_000
    bus_error_limit_ns: int = 0  # 0: an error of the bus ends the controller


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelModel(Effects):
    """Effects of the emulated edge from one source to one robot."""

    source: str  # a robot, the leader or the localisation system
    seed: str  # of its random streams


def channel_seed(seed: int, source: str, hearer: str) -> str:
    """The seed of the emulated edge from a source to a robot, of a scenario's seed."""
    return f"{seed} {source} -> {hearer}"


def located(channels: Iterable[ChannelModel]) -> tuple[str, ...]:
    """Robots whose poses the emulated network needs: effects depend on the distance to them."""
    return tuple(model.source for model in channels if model.distance is not None)


@dataclass(frozen=True, slots=True)
class AgentBrief:
    """Everything that the controller process of one robot receives at its start."""

    robot: str
    law: Choice  # with its gains
    signals: tuple[Signal, ...]  # of every tick, the law's among them
    wheels: Wheels
    coordination: Coordination
    s_0: float  # the path variable at t = 0 [m]
    reach: Reach  # what neighbours can say
    path: ReferencePath
    offset: FormationOffset
    hears: tuple[InEdge, ...]  # of its in-neighbours, sorted: a_ij
    leader_link: InEdge | None  # h_i; None: it doesn't hear the leader
    membership: Membership  # when it is part of the formation
    localisation: str  # "fused" | "external" | "odometry"
    schedule: Schedule
    drives: DriveLink
    host: HostLimits
    channels: tuple[ChannelModel, ...]  # the emulated edges to it; others have no effects
    faults: tuple[PlannedFault, ...]  # of messages to it, and of its process
    seed: int  # of the scenario
    phase_ns: int  # in real time, this much after a tick's time, the plant's, the controller acts
    bus: Settings  # keyword arguments of can.Bus, verbatim
    network: NetworkLink
    detached: bool = False  # no launcher is its parent: the run's end is when the launcher's
    # token on the network goes
    logs_inputs: bool = False  # for a replay
    recorder: int | None = None  # inherited file descriptor of its socket to the recorder, if that
    # is on the same machine
    rejoins: bool = False  # a run that goes on; another process was its controller
    resumes_tick: int = 0  # in lockstep, of one that re-joins: the first tick that it is asked

    def channel_seed(self, source: str) -> str:
        """The seed of the emulated edge from a source to this robot."""
        return channel_seed(self.seed, source, self.robot)

    @property
    def located(self) -> tuple[str, ...]:
        """In-neighbours whose poses the emulated network needs."""
        return located(self.channels)


# --- the plant ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelDisturbance(Disturbance):
    """Section [disturbance] of one robot, for t ≥ 0."""

    phase_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveModel:
    """Both emulated drives of one robot."""

    choice: Choice  # of the protocol, with its section
    limited: bool  # False: torque reaches the wheel as commanded (preset ideal)
    serial_number: int  # of the right drive; the left one has the next number
    encoder_period_ns: int
    command_latency_ns: tuple[int, int] = (0, 0)  # from a frame's end until firmware acts on it

    @property
    def section(self) -> Parameters:
        """Section [drive], of the type that the protocol's row names."""
        return self.choice.parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorModel(Motor):
    """Section [motor] with what it inherits from [drive]: see `plant.motor`."""

    torque_constant_N_m_A: float  # of the motor
    current_limit_A: float  # of the power stage
    assumed_torque_constant_N_m_A: float  # set in the drive


@dataclass(frozen=True, slots=True)
class PowertrainModel:
    """What lies between a robot's drives and its wheels."""

    motor: MotorModel
    encoder: Encoder
    supply: Supply
    seed: int  # of the robot's noise


@dataclass(frozen=True, slots=True, kw_only=True)
class WireModel(Bus):
    """Section [bus] of buses with a bit rate: see `bridge.wire.wire`."""

    restart_ns: int | None  # a host starts to recover from bus-off this much later; None: never
    drive_restart_ns: int | None


@dataclass(frozen=True, slots=True)
class RobotBrief:
    """One robot as the plant sees it."""

    robot: str
    bus: str
    body: Body
    disturbance: WheelDisturbance
    drive: DriveModel
    powertrain: PowertrainModel
    ideal_powertrain: bool  # motors and encoders are ideal; what faults add has the model's values
    right_node: int
    left_node: int
    mounting: Mounting
    pose: Pose
    v_m_s: float
    omega_rad_s: float


@dataclass(frozen=True, slots=True)
class PlantBrief:
    """Everything that the plant process receives at its start."""

    robots: tuple[RobotBrief, ...]
    schedule: Schedule
    substeps: int  # RK4 steps per control period
    speed: float  # real-time factor that the run is held to; 0: as fast as possible
    seed: int
    wire: WireModel | None  # of every bus; None: ideal, frames take no time
    traffic: bool  # tell the recorder what crosses the buses
    faults: tuple[PlannedFault, ...]  # of bodies, drives, buses and the localisation system
    absences: tuple[Absence, ...]  # of controllers, in lockstep
    network: NetworkLink
    listeners: tuple[tuple[str, int], ...] = ()  # bus, inherited file descriptor of its socket
    attached: tuple[tuple[str, Settings], ...] = ()  # bus, keyword arguments of can.Bus: not ours
    real_robots: tuple[tuple[str, Pose], ...] = ()  # robots that aren't emulated; where they start
    detached: bool = False  # as an agent's
    recorder: int | None = None  # as an agent's
    controllers: tuple[
        tuple[str, str], ...
    ] = ()  # robot, secret: the clients that lockstep waits for


@dataclass(frozen=True, slots=True)
class LeaderBrief:
    """The virtual leader."""

    speed_changes: tuple[SpeedChange, ...]  # v_r(t), in order of time


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewerBrief:
    """Everything that the viewer receives at its start."""

    scenario_toml: str
    folder: str  # of the run: its record
    door: str  # path of the socket on which the launcher answers requests
    token: str  # of this viewer: part of its page's address, and what it shows at the door
    start_deadline_s: float
    network: NetworkLink


@dataclass(frozen=True, slots=True)
class DrawnRobot:
    """A robot as 3-D views draw it."""

    colour: str = "#7d7d7d"
    wheels: Wheels = Wheels(radius_m=0.04, half_track_m=0.1)
    path: tuple[ReferencePath, FormationOffset] | None = None
    s_span: tuple[float, float] = (0.0, 0.0)  # of its path variable in a run [m]


@dataclass(frozen=True, slots=True)
class Drawing:
    """What is known of a run besides its rows, for those that draw it; empty: nothing."""

    robots: tuple[DrawnRobot, ...] = ()
    edges: tuple[tuple[str, str, Windows | None], ...] = ()  # speaker, hearer, when it exists
    silence_s: float = 2.0  # age from which on what was heard doesn't count


NO_DRAWING = Drawing()
"""Of a run of which nothing is known besides its rows."""


@dataclass(frozen=True, slots=True)
class RecorderBrief:
    """Everything that the recorder receives at its start."""

    path: str  # of the record
    robots: tuple[str, ...]
    controllers: tuple[tuple[Signal, ...], ...]  # rows of their controllers
    buses: tuple[str, ...]  # whose traffic is recorded
    bus_formats: tuple[str, ...]  # "blf", "log"
    scenario_toml: str
    period_ns: int
    start_deadline_s: float
    hello_every_s: float
    network: NetworkLink
    runtime_folder: str  # holds the buses' sockets; goes when the launcher was killed
    ticks: int  # of the run: no rows are of later ones
    last_frame_ns: int  # bus time after which no frame ends
    fills_gaps: bool = False  # sources may be cut off or start again: missing rows aren't numbers
    logged_inputs: bool = False  # controllers log theirs
    elsewhere: tuple[str, ...] = ()  # processes that are heard over the network
    sockets: int = -1  # inherited file descriptor: where the sockets of all others come
    drawing: Drawing = NO_DRAWING  # for 3-D views of the record
