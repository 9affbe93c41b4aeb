"""The roles of a run, one row each: name, process, brief, rights on the network, roles it follows.

    role          processes                              started by
    plant         one                                    `fleetloop run` or `plant --join`
    agent         one per robot, agent/<robot>           `fleetloop run` or `fleetloop agent`
    recorder      one, on the launcher's machine         `fleetloop run`
    viewer        one, on the launcher's machine         `fleetloop run`, when it is asked for
    localisation  one, if robots aren't emulated         the operator: a program of the robots' own
    launcher      one                                    the operator; its session is in the router

Spawning, access control, keys and deployments read this table. A role more is a row here, its
module with a `main`, and the function that fills its brief (`fleetloop.launch.spawn.BRIEFS`).
Modules are named by strings: the processes that read the table import none of them.

A process that is no observer ends by itself at the closing tick; an observer goes on until it is
asked to stop (SIGTERM). The recorder is one, and ends by itself once it has written the last row.
"""

from dataclasses import dataclass
from enum import Enum, auto

from configs.brief import AgentBrief, PlantBrief, RecorderBrief, ViewerBrief


class Topic(Enum):
    """Keys of a run by their meaning to a role; `bridge.network.access` resolves them."""

    OWN_PATH = auto()
    OWN_POSE = auto()
    OWN_TELEMETRY = auto()
    OWN_INPUTS = auto()
    PATHS_OF_IN_NEIGHBOURS = auto()
    SILENCES_OF_IN_NEIGHBOURS = auto()
    POSES_OF_LOCATED_NEIGHBOURS = auto()  # whose distance changes the emulated network
    LEADER_SPEED = auto()  # of robots with h_i = 1
    EMULATED_POSES = auto()  # of the robots that the plant emulates
    MEASURED_POSES = auto()  # of the robots that it doesn't
    SILENCES = auto()
    TRUTHS = auto()
    TELEMETRIES = auto()
    INPUTS = auto()
    TRAFFIC = auto()
    GO = auto()
    ORDERS_OF_CONTROLLERS = auto()  # in lockstep, where the plant hands them on
    PROGRESS = auto()  # of all processes of the run
    NOTICES = auto()  # likewise


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """One kind of process of a run."""

    name: str
    module: str = ""
    """Has its `main`, which returns the exit status; empty for a role that no run starts."""
    brief: type | None = None
    """The type of its brief, given on standard input."""
    per_robot: bool = False
    in_step: bool = False
    """Has work at every tick: such processes are forked from one, with the same memory layout."""
    beside_launcher: bool = False
    """Can't be placed on another machine."""
    observer: bool = False
    """Takes no part in the run: it is stopped once plant and controllers have ended."""
    on_request: bool = False
    """No part of the run's start: started when it is asked for. It puts nothing on the network."""
    takes_orders: bool = False
    """Carries out faults that are ordered during a run."""
    puts: tuple[Topic, ...] = ()
    hears: tuple[Topic, ...] = ()
    watches: tuple[str, ...] = ()
    """Roles whose liveliness token and report it may see."""

    def process(self, robot: str = "") -> str:
        """The name of this role's process: plant, or agent/<robot>."""
        return f"{self.name}/{robot}" if self.per_robot else self.name

    def identity(self, robot: str = "") -> str:
        """The user as which this role's process comes to the router: plant, or agent-<robot>."""
        return identity_of(self.process(robot))


LAUNCHER = Role(name="launcher")
PLANT = Role(
    name="plant",
    module="plant.__main__",
    brief=PlantBrief,
    in_step=True,
    takes_orders=True,
    puts=(
        Topic.EMULATED_POSES,
        Topic.SILENCES,
        Topic.TRUTHS,
        Topic.TRAFFIC,
        Topic.ORDERS_OF_CONTROLLERS,
    ),
    hears=(Topic.GO, Topic.MEASURED_POSES),
    watches=(LAUNCHER.name,),
)
AGENT = Role(
    name="agent",
    module="agents.__main__",
    brief=AgentBrief,
    per_robot=True,
    in_step=True,
    takes_orders=True,
    puts=(Topic.OWN_PATH, Topic.OWN_TELEMETRY, Topic.OWN_INPUTS),
    hears=(
        Topic.OWN_POSE,
        Topic.GO,
        Topic.PATHS_OF_IN_NEIGHBOURS,
        Topic.SILENCES_OF_IN_NEIGHBOURS,
        Topic.POSES_OF_LOCATED_NEIGHBOURS,
        Topic.LEADER_SPEED,
    ),
    watches=(LAUNCHER.name,),
)
RECORDER = Role(
    name="recorder",
    module="fleetloop.record.recorder",
    brief=RecorderBrief,
    beside_launcher=True,
    observer=True,
    hears=(Topic.TRUTHS, Topic.TRAFFIC, Topic.TELEMETRIES, Topic.INPUTS),
)
VIEWER = Role(
    name="viewer",
    module="fleetloop.live.__main__",
    brief=ViewerBrief,
    beside_launcher=True,
    observer=True,
    on_request=True,
    hears=(Topic.TRUTHS, Topic.TELEMETRIES, Topic.PROGRESS, Topic.NOTICES),
)
LOCALISATION = Role(name="localisation", puts=(Topic.MEASURED_POSES,), hears=(Topic.GO,))

ROLES = (PLANT, AGENT, RECORDER, LOCALISATION, VIEWER, LAUNCHER)
"""In the order in which a run starts them."""
STARTED = tuple(role for role in ROLES if role.module and not role.on_request)
"""At its start."""
_OBSERVERS = frozenset(role.name for role in ROLES if role.observer)
_ORDERED = frozenset(role.name for role in ROLES if role.takes_orders)


def is_observer(process: str) -> bool:
    """Whether a process takes no part in the run."""
    return process.partition("/")[0] in _OBSERVERS


def takes_orders(process: str) -> bool:
    """Whether a process carries out faults that are ordered during a run."""
    return process.partition("/")[0] in _ORDERED


def identity_of(process: str) -> str:
    """The user as which a process comes to the router."""
    return process.replace("/", "-")


def short_name(process: str) -> str:
    """Display name of a process: the robot of a controller, the role of others."""
    return process.removeprefix(f"{AGENT.name}/")


def processes_of(robots: tuple[str, ...]) -> tuple[str, ...]:
    """The processes of a run, in the order in which it starts them."""
    return tuple(
        role.process(robot) for role in STARTED for robot in (robots if role.per_robot else ("",))
    )
