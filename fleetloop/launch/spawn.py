"""Bring the roles of a run on this machine to life: sockets first, then a process each.

Each is told, by its brief, exactly what it may know; its buses' listening sockets go to the plant.
"""

import secrets
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from bridge.can_bus import sockets
from bridge.network import access
from configs.brief import AgentBrief, NetworkLink, PlantBrief, RecorderBrief
from configs.deployment import PLANT, RECORDER, Deployment, agent_role
from configs.loading import to_toml
from configs.resolve import agent_brief, plant_brief, schedule
from configs.scenario import Scenario
from fleetloop.launch import placement
from fleetloop.launch.child import Child
from fleetloop.launch.fork_server import Nursery

AFTERWARDS_NS = 60 * 10**9
"""Bus time in which frames may still end after the closing tick, in real time on a slow machine."""
Links = Mapping[str, NetworkLink]
"""How each identity reaches the router."""


@dataclass(frozen=True, slots=True)
class Orders:
    """What is to be run, and how."""

    scenario: Scenario
    deployment: Deployment
    record: Path
    speed: float
    profile: bool


def spawn(
    orders: Orders, links: Links, folder: Path, nursery: Nursery, children: list[Child]
) -> None:
    """Start the processes, the recorder last, and add them to `children` as they are born.

    Raises:
        InfrastructureError: a socket or a process can't be had.
    """
    scenario, deployment = orders.scenario, orders.deployment
    realtime = schedule(scenario).realtime
    here = deployment.runs_here
    robots = [r for r in scenario.names if deployment.is_ours(r) and here(PLANT)]
    waited_for = [] if realtime else robots
    told = {robot: secrets.token_hex(16) for robot in waited_for}

    def start(name: str, module: str, fds: Sequence[int] = ()) -> Child:
        children.append(Child(nursery, name, module, fds))
        return children[-1]

    if here(PLANT):
        buses = list(dict.fromkeys(scenario.bus_of(robot) for robot in robots))
        with ExitStack() as listening:
            listeners = sockets.listen(folder, buses)
            for listener in listeners.values():
                listening.enter_context(listener)
            plant = start(PLANT, "plant", [listeners[bus].fileno() for bus in buses])
        brief = replace(
            _plant(orders, links),
            listeners=tuple(zip(buses, plant.fds, strict=True)),
            controllers=tuple(told.items()),
        )
        plant.tell(brief)
    for robot in scenario.names:
        if here(role := agent_role(robot)):
            bus = scenario.bus_of(robot)
            socket = str(sockets.socket_path(folder, bus)) if robot in robots else ""
            agent = _agent(orders, links, robot, socket, told.get(robot, ""))
            start(role, "agents").tell(agent)
    start(RECORDER, "fleetloop.record.recorder").tell(_recorder(orders, links, folder))


def _plant(orders: Orders, links: Links) -> PlantBrief:
    brief = plant_brief(
        orders.scenario,
        network=links[access.PLANT],
        speed=orders.speed,
        profile=orders.profile,
    )
    return placement.robots_of_plant(brief, orders.deployment)


def _agent(orders: Orders, links: Links, robot: str, socket: str, secret: str) -> AgentBrief:
    return agent_brief(
        orders.scenario,
        robot,
        network=links[access.agent_user(robot)],
        bus=placement.agent_bus(orders.deployment, robot, secret=secret, socket=socket),
        speed=orders.speed,
        profile=orders.profile,
    )


def _recorder(orders: Orders, links: Links, folder: Path) -> RecorderBrief:
    ticks = schedule(orders.scenario, orders.speed)
    return RecorderBrief(
        str(orders.record),
        orders.scenario.names,
        _recorded(orders),
        orders.scenario.bus.record,
        to_toml(orders.scenario),
        ticks.period_ns,
        ticks.start_deadline_s,
        ticks.hello_every_s,
        links[access.RECORDER],
        str(folder),
        ticks.ticks,
        ticks.bus_time_ns(ticks.ticks) + AFTERWARDS_NS,
    )


def _recorded(orders: Orders) -> tuple[str, ...]:
    """The buses whose traffic the plant tells the recorder."""
    scenario, emulates = orders.scenario, orders.deployment.emulates
    if not scenario.bus.record:
        return ()
    return tuple(dict.fromkeys(scenario.bus_of(r) for r in scenario.names if emulates(r)))
