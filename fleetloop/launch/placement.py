"""Scenario and deployment → the place of each role: its buses, its network, its credentials."""

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bridge.network import access
from configs.brief import PlantBrief, located
from configs.connections import NetworkLink, Outside, Settings
from configs.deployment import Deployment, NetworkSection
from configs.errors import ScenarioError
from configs.resolve import channels
from configs.roles import AGENT, LAUNCHER, LOCALISATION, PLANT, identity_of, processes_of
from configs.scenario import Scenario
from configs.users import passwords
from fleetloop.launch.clock_offsets import Hop

if TYPE_CHECKING:
    from fleetloop.certificates.folder import CertificateFolder


def robots_of_plant(brief: PlantBrief, deployment: Deployment) -> PlantBrief:
    """The plant's brief with the robots that it emulates, and the others as it sees them."""
    emulated = tuple(r for r in brief.robots if deployment.emulates(r.robot))
    attached = tuple(
        (r.bus, deployment.plant_bus_of(r.robot))
        for r in emulated
        if not deployment.is_ours(r.robot)
    )
    real_robots = tuple((r.robot, r.pose) for r in brief.robots if r not in emulated)
    return replace(brief, robots=emulated, attached=attached, real_robots=real_robots)


def agent_bus(
    deployment: Deployment, robot: str, *, secret: str = "", socket: str = ""
) -> Settings:
    """Keyword arguments of `can.Bus` for a controller.

    Args:
        deployment: where the robot's bus is.
        robot: whose controller.
        secret: by which its bus knows the client to wait for; "" in real time, without waiting.
        socket: where its bus of ours is.
    """
    settings = deployment.bus_of(robot)
    if not deployment.is_ours(robot):
        return settings
    pace: dict[str, str | bool] = {"synchronous": robot, "secret": secret} if secret else {}
    ours = dict(settings) | (pace or {"batched": True})
    if socket:
        ours["channel"] = socket
    return tuple(sorted(ours.items()))


def run_name(scenario: Scenario, deployment: Deployment) -> str | None:
    """The run's name in every key if machines had to agree on one."""
    network = deployment.network
    return None if network is None else network.run or scenario.name


def check_credentials(scenario: Scenario, deployment: Deployment) -> None:
    """Refuse a run whose router could not authenticate its clients, before any start.

    Raises:
        ScenarioError: a password or a file of TLS is missing, wrong or revoked; the text names key
            and file.
    """
    guests(scenario, deployment)
    if is_external(deployment):
        links(scenario, deployment)
    elif deployment.network is not None:
        host = deployment.network.endpoint.partition("/")[2].rpartition(":")[0]
        _proved_name(deployment.network, None, host.strip("[]"))


def _proved_name(network: NetworkSection, identity: str | None, host: str = "") -> str:
    """The common name of the certificate by which this machine proves an identity; "" without."""
    files = network.tls_of(identity)
    if files is None:
        return ""
    from bridge.network.tls import check_tls

    if network.certificates is None:
        return check_tls(files, identity, "network.tls.", host)
    try:
        return check_tls(files, identity, "", host)
    except ScenarioError as error:
        raise ScenarioError(f"network.certificates: {error}") from error


def outside(deployment: Deployment) -> Outside | None:
    """Where the router listens for those on other machines."""
    network = deployment.network
    if network is None:
        return None
    return Outside(network.listen or network.endpoint, network.tls_of(None))


def bus_guests(deployment: Deployment) -> Mapping[str, tuple[str, ...]]:
    """Access to buses from other machines, by identity; none for a revoked one."""
    if deployment.network is None:
        return {}
    revoked = kept_out(deployment)
    return {user: may for user, may in deployment.network.guests.items() if user not in revoked}


def kept_out(deployment: Deployment) -> Mapping[str, str]:
    """The guests whose certificate is revoked, and why they have no rights."""
    network = deployment.network
    if network is None or network.certificates is None or not network.guests:
        return {}
    with _named_certificates(network.certificates) as folder:
        revoked = [user for user in network.guests if folder.is_revoked(folder.certificate(user))]
    return dict.fromkeys(revoked, "its certificate is revoked")


def guests(scenario: Scenario, deployment: Deployment) -> Mapping[str, str]:
    """Passwords of remote clients, by identity.

    Raises:
        ScenarioError: the deployment's credentials lack one of them.
    """
    roles = deployment.elsewhere(scenario)
    if is_external(deployment):
        roles = (*processes_of(scenario.names), LAUNCHER.name)
    identities = [identity_of(role) for role in roles]
    if any(not deployment.emulates(robot) for robot in scenario.names):
        identities.append(LOCALISATION.name)
    identities += bus_guests(deployment)
    if deployment.network is not None and deployment.network.certificates is not None:
        with _named_certificates(deployment.network.certificates) as folder:
            return {identity: folder.proved_name(identity) for identity in identities}
    known = passwords(deployment.network, tuple(identities))
    return known | {user: _as_option(known[user]) for user in bus_guests(deployment)}


@contextlib.contextmanager
def _named_certificates(path: Path) -> "Iterator[CertificateFolder]":
    """The authority's folder; what is wrong with it is said with the deployment's key."""
    from fleetloop.certificates.folder import CertificateFolder

    try:
        yield CertificateFolder(path)
    except ScenarioError as error:
        raise ScenarioError(f"network.certificates: {error}") from error


def _as_option(password: str) -> str:
    # Imports python-can, which a run without guests does without.
    from bridge.can_bus.options import as_option

    return as_option(password)


def access_plan(scenario: Scenario, deployment: Deployment, run: str) -> access.AccessPlan:
    """Rights and credentials of all clients of the router.

    Raises:
        ScenarioError: the deployment's credentials lack an identity.
    """
    graph, network, clock = scenario.topology, deployment.network, scenario.clock
    realtime = clock.mode == "realtime"
    planned = access.plan(
        run,
        scenario.names,
        graph.in_neighbours,
        graph.leader,
        buses=scenario.buses,
        real_robots=[robot for robot in scenario.names if not deployment.emulates(robot)],
        located={robot: located(channels(scenario, robot)) for robot in scenario.names},
        guests=guests(scenario, deployment),
        bus_guests=tuple(bus_guests(deployment)),
        certified=network is not None and network.tls_of(None) is not None,
        kept_out=kept_out(deployment),
        external=is_external(deployment),
        share_period_s=clock.share_period_s if realtime else None,
        localisation_period_s=clock.localisation_period_s if realtime else None,
    )
    if network is None or network.certificates is None:
        return planned
    with _named_certificates(network.certificates) as folder:
        return replace(planned, expiries=folder.expiries())


def hops(scenario: Scenario, deployment: Deployment) -> list[Hop]:
    """Which process uses what another one dates: neighbours' path states, poses of the plant."""
    paths = [Hop(AGENT.process(j), AGENT.process(i)) for j, i in scenario.topology.edges]
    emulated = [robot for robot in scenario.names if deployment.emulates(robot)]
    return paths + [Hop(PLANT.name, AGENT.process(robot)) for robot in emulated]


def is_external(deployment: Deployment) -> bool:
    """Whether the router is a program of its own."""
    return deployment.network is not None and deployment.network.external


def links(scenario: Scenario, deployment: Deployment) -> Mapping[str, NetworkLink]:
    """How launcher and roles of this machine reach an external router, by identity.

    Raises:
        ScenarioError: the deployment's credentials lack one of them.
    """
    here = [role for role in processes_of(scenario.names) if deployment.runs_here(role)]
    return {
        identity_of(role): network_link(scenario, deployment, role)
        for role in (*here, LAUNCHER.name)
    }


def network_link(scenario: Scenario, deployment: Deployment, role: str) -> NetworkLink:
    """How a role that is started by itself reaches the router.

    Raises:
        ScenarioError: the deployment has no network, or no credentials for the role.
    """
    network = deployment.network
    if network is None:
        raise ScenarioError(
            f"{role} on its own needs a deployment with [network] endpoint: where its router is"
        )
    user = identity_of(role)
    run, tls = network.run or scenario.name, network.tls_of(user)
    if tls is not None:
        password = _proved_name(network, user)
    else:
        (password,) = passwords(network, (user,)).values()
    return NetworkLink(run, network.endpoint, user, password, tls, rejoin_s=network.rejoin_s)
