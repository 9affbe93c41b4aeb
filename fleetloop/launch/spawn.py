"""Starts the roles of a run on this machine: sockets first, then a process each.

Each is told, by its brief, exactly what it may know; its buses' listening sockets go to the plant.
"""

import secrets
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from bridge.can_bus import sockets
from configs.brief import AgentBrief, PlantBrief, RecorderBrief, ViewerBrief
from configs.connections import NetworkLink
from configs.deployment import Deployment
from configs.faults.base import PlannedFault
from configs.loading import to_toml
from configs.resolve import agent_brief, agent_faults, plant_brief, schedule, signals_of
from configs.roles import AGENT, PLANT, RECORDER, STARTED, VIEWER
from configs.scenario import Scenario
from configs.ticks import Ticks
from fleetloop.door.server import NAME as DOOR
from fleetloop.launch import placement
from fleetloop.launch.child import Child
from fleetloop.launch.drawn import drawing
from fleetloop.launch.fork_server import ForkServer
from fleetloop.launch.row_lines import RowLines

AFTERWARDS_NS = 60 * 10**9
"""Bus time in which frames may still end after the closing tick, in real time on a slow machine."""
Links = Mapping[str, NetworkLink]
"""How each identity reaches the router."""


@dataclass(frozen=True, slots=True)
class Orders:
    """The work of a run, and its settings."""

    scenario: Scenario
    deployment: Deployment
    record: Path
    speed: float
    profile: bool
    secrets: Mapping[str, str]
    """By robot: how its bus knows the controller that it waits for; none in real time."""

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        deployment: Deployment,
        record: Path,
        speed: float,
        *,
        profile: bool,
    ) -> "Orders":
        """Orders with new secrets."""
        waited_for = () if schedule(scenario).realtime else ours(scenario, deployment)
        told = {robot: secrets.token_hex(16) for robot in waited_for}
        return cls(scenario, deployment, record, speed, profile, told)


@dataclass(frozen=True, slots=True)
class Place:
    """Where one process of a run is, among the others."""

    orders: Orders
    network: NetworkLink
    folder: Path
    robot: str  # of a role per robot


def spawn(
    orders: Orders,
    links: Links,
    folder: Path,
    fork_server: ForkServer,
    lines: RowLines,
    children: list[Child],
) -> None:
    """Start the processes in the order of their roles and add them to `children` as they start.

    Raises:
        InfrastructureError: a socket or a process can't be had.
    """
    scenario = orders.scenario
    for role in STARTED:
        for robot in scenario.names if role.per_robot else ("",):
            if not orders.deployment.runs_here(role.process(robot)):
                continue
            place = Place(orders, links[role.identity(robot)], folder, robot)
            brief = BRIEFS[role.name](place)
            if isinstance(brief, PlantBrief):
                children.append(_start_plant(brief, place, fork_server, lines))
            elif isinstance(brief, AgentBrief):
                children.append(_start_agent(brief, fork_server, lines))
            elif isinstance(brief, RecorderBrief):
                children.append(_start_recorder(brief, fork_server, lines))
            else:
                children.append(Child(fork_server, role.process(robot), role.module))
                children[-1].tell(brief)


def respawn(
    orders: Orders,
    links: Links,
    folder: Path,
    robot: str,
    fork_server: ForkServer,
    lines: RowLines,
    faults: Iterable[PlannedFault],
    resumes_tick: int = 0,
) -> Child:
    """Start the controller of a robot again in a run that goes on, in lockstep at a tick.

    Its faults are those of the run, the ordered ones among them.

    Raises:
        InfrastructureError: a process can't be had.
    """
    place = Place(orders, links[AGENT.identity(robot)], folder, robot)
    known = agent_faults(faults, robot)
    brief = replace(_agent(place), rejoins=True, resumes_tick=resumes_tick, faults=known)
    return _start_agent(brief, fork_server, lines)


def ours(scenario: Scenario, deployment: Deployment) -> tuple[str, ...]:
    """The robots on buses of ours, which the plant of this machine serves."""
    if not deployment.runs_here(PLANT.name):
        return ()
    return tuple(robot for robot in scenario.names if deployment.is_ours(robot))


def _start_agent(brief: AgentBrief, fork_server: ForkServer, lines: RowLines) -> Child:
    process = AGENT.process(brief.robot)
    with lines.connect(process) as end:
        child = Child(fork_server, process, AGENT.module, [end.fileno()])
    child.tell(replace(brief, recorder=child.fds[0]))
    return child


def _start_recorder(brief: RecorderBrief, fork_server: ForkServer, lines: RowLines) -> Child:
    child = Child(fork_server, RECORDER.name, RECORDER.module, [lines.recorders])
    lines.given()
    child.tell(replace(brief, sockets=child.fds[0]))
    return child


def _start_plant(
    brief: PlantBrief, place: Place, fork_server: ForkServer, lines: RowLines
) -> Child:
    """Open the listening sockets of its buses, and hand them to it."""
    orders = place.orders
    buses = list(
        dict.fromkeys(
            orders.scenario.bus_of(robot) for robot in ours(orders.scenario, orders.deployment)
        )
    )
    with ExitStack() as listening, lines.connect(PLANT.name) as end:
        listeners = sockets.listen(place.folder, buses)
        for listener in listeners.values():
            listening.enter_context(listener)
        fds = [listeners[bus].fileno() for bus in buses]
        child = Child(fork_server, PLANT.name, PLANT.module, [*fds, end.fileno()])
    *fds, recorder = child.fds
    listening_at = tuple(zip(buses, fds, strict=True))
    child.tell(replace(brief, listeners=listening_at, recorder=recorder))
    return child


def _plant(place: Place) -> PlantBrief:
    orders = place.orders
    brief = plant_brief(
        orders.scenario, network=place.network, speed=orders.speed, profile=orders.profile
    )
    brief = placement.robots_of_plant(brief, orders.deployment)
    return replace(brief, controllers=tuple(place.orders.secrets.items()))


def _agent(place: Place) -> AgentBrief:
    orders, robot = place.orders, place.robot
    socket = ""
    if robot in ours(orders.scenario, orders.deployment):
        socket = str(sockets.socket_path(place.folder, orders.scenario.bus_of(robot)))
    secret = place.orders.secrets.get(robot, "")
    return agent_brief(
        orders.scenario,
        robot,
        network=place.network,
        bus=placement.agent_bus(orders.deployment, robot, secret=secret, socket=socket),
        speed=orders.speed,
        profile=orders.profile,
    )


def _recorder(place: Place) -> RecorderBrief:
    orders = place.orders
    ticks = schedule(orders.scenario, orders.speed)
    return RecorderBrief(
        str(orders.record),
        orders.scenario.names,
        tuple(signals_of(orders.scenario, robot) for robot in orders.scenario.robot),
        _recorded(orders),
        orders.scenario.bus.record,
        to_toml(orders.scenario),
        ticks.period_ns,
        ticks.start_deadline_s,
        ticks.hello_every_s,
        place.network,
        str(place.folder),
        ticks.ticks,
        Ticks(ticks).bus_time_ns(ticks.ticks) + AFTERWARDS_NS,
        fills_gaps=_may_have_gaps(orders),
        logged_inputs=orders.scenario.records_inputs,
        elsewhere=orders.deployment.elsewhere(orders.scenario),
        drawing=drawing(orders.scenario),
    )


def viewer_brief(orders: Orders, links: Links, run: str, token: str) -> ViewerBrief | None:
    """The brief of the viewer; None if the router isn't the run's, and knows no viewer."""
    network = links.get(VIEWER.identity())
    if network is None:
        return None
    return ViewerBrief(
        scenario_toml=to_toml(orders.scenario),
        folder=str(orders.record.parent.absolute()),
        door=str(sockets.folder_of(run) / DOOR),
        token=token,
        start_deadline_s=schedule(orders.scenario).start_deadline_s,
        network=network,
    )


def _may_have_gaps(orders: Orders) -> bool:
    """Whether controllers may be cut off, absent or started again."""
    scenario = orders.scenario
    stops = any(one.PLACE == "process" for one in scenario.fault)
    goes_on = schedule(scenario).on_late != "abort"
    return orders.deployment.may_rejoin or scenario.host.restarts > 0 or stops or goes_on


def _recorded(orders: Orders) -> tuple[str, ...]:
    """The buses whose traffic the plant tells the recorder."""
    scenario, emulates = orders.scenario, orders.deployment.emulates
    if not scenario.bus.record:
        return ()
    return tuple(dict.fromkeys(scenario.bus_of(r) for r in scenario.names if emulates(r)))


BRIEFS: Mapping[str, Callable[[Place], object]] = {
    PLANT.name: _plant,
    AGENT.name: _agent,
    RECORDER.name: _recorder,
}
"""Builder of the brief of each role that a run starts."""
