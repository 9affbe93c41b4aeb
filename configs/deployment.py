"""The deployment file as a type: *where* a scenario runs; the default is all of it on this machine.

    roles      what `fleetloop run` starts here; the other roles are started where they belong, by
               `fleetloop agent` on the robots, and wait for the run
    network    where the router listens, and the identities of roles on other machines
    robot.NAME the robot's CAN bus, verbatim for `can.Bus`, and whether the plant emulates the robot

One file serves all machines of a fleet: secrets are in files that it names. A bus of another
interface has a clock of its own, so it needs real time.
"""

import tomllib
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from configs import patterns
from configs.complaints import complaints, refusal
from configs.connections import OURS, Settings
from configs.errors import Complaint, Problem, ScenarioError
from configs.faults.base import Fault
from configs.faults.plan import targets_of
from configs.files import expanded
from configs.parameters import (
    FilePath,
    Name,
    Parameters,
    Pattern,
    Positive,
    SecondsOrZero,
    as_tuples,
    parameter,
)
from configs.roles import AGENT, ROLES, STARTED, identity_of, processes_of
from configs.scenario import Scenario
from configs.tls import ROUTER, TlsFiles, files_in
from configs.wording import MISSING

Endpoint = Annotated[str, Pattern(patterns.ENDPOINT)]


class BusSection(BaseModel):
    """Keyword arguments of `can.Bus`, verbatim: whatever the interface takes."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    interface: Annotated[str, Field(min_length=1)] = OURS
    channel: Annotated[str | int, Field(union_mode="left_to_right")] | None = Field(
        None, description="the robot's name if not given"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSection(Parameters):
    """Where one robot is."""

    bus: BusSection = parameter(BusSection(), "keyword arguments of can.Bus")
    plant_bus: BusSection | None = parameter(
        None, "the plant's own interface to that bus; the same if not given"
    )
    emulated: bool | None = parameter(
        None,
        "the plant emulates its drives and its body; if not given: on our buses only,"
        " because on another bus real drives may listen",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkSection(Parameters):
    """How the machines reach each other."""

    endpoint: Endpoint = field(
        metadata={"description": "where roles on other machines reach the router"}
    )
    listen: Endpoint | None = parameter(
        None, "where the router listens, for example on all addresses; else endpoint"
    )
    router: Literal["launcher", "external"] = parameter(
        "launcher",
        "external: a program of its own at endpoint, with the configuration that"
        " `fleetloop network --router-config` writes; all roles are its clients",
    )
    run: Annotated[str, Pattern(patterns.RUN)] | None = parameter(
        None, "the run's name in every key; the scenario's if not given"
    )
    rejoin_s: SecondsOrZero = parameter(
        0.0,
        "for so long a role on another machine may be cut off: meanwhile its robot stops, then it"
        " goes on; if longer, the run ends",
    )
    clock_tolerance_m: Positive = parameter(
        0.02, "a run is refused whose clocks displace a robot by more than that for one hop"
    )
    users: FilePath | None = parameter(
        None,
        "lines identity:password, all of them at the router, its own on a robot",
    )
    certificates: FilePath | None = parameter(
        None, "the folder of `fleetloop certs`, or of this machine's files from it"
    )
    tls: TlsFiles | None = parameter(None, "certificates of another authority")
    guests: dict[Name, tuple[str, ...]] = field(
        default_factory=dict,
        metadata={
            "description": "the buses that each guest may open with can.Bus(endpoint=...) from"
            ' another machine; "*" for all'
        },
    )

    @property
    def external(self) -> bool:
        """Whether the router is a program of its own."""
        return self.router == "external"

    def tls_of(self, identity: str | None) -> TlsFiles | None:
        """The files of mutual TLS of an identity, of the router if None; None: passwords."""
        if self.certificates is None:
            return self.tls
        return files_in(self.certificates, identity or ROUTER)


class Deployment(BaseModel):
    """Where the roles, buses and emulated robots of a scenario are."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    schema_: Literal[1] = Field(1, alias="schema", description="version of this format")
    description: str = ""
    roles: tuple[str, ...] | None = Field(
        None, description='"plant", "recorder", "agent/<robot>"; all if not given'
    )
    network: NetworkSection | None = None
    robot: dict[Name, RobotSection] = Field(default_factory=dict)

    @property
    def may_rejoin(self) -> bool:
        """Whether roles may be cut off and come back."""
        return self.network is not None and self.network.rejoin_s > 0.0

    def bus_of(self, robot: str) -> Settings:
        """Keyword arguments of `can.Bus` for a robot's bus, sorted."""
        bus = self.robot.get(robot, RobotSection()).bus
        return _settings(robot, bus)

    def plant_bus_of(self, robot: str) -> Settings:
        """Keyword arguments of `can.Bus` for the plant's end of a robot's bus, sorted."""
        section = self.robot.get(robot, RobotSection())
        return _settings(robot, section.plant_bus or section.bus)

    def is_ours(self, robot: str) -> bool:
        """Whether the plant holds the robot's bus itself."""
        return self.robot.get(robot, RobotSection()).bus.interface == OURS

    def emulates(self, robot: str) -> bool:
        """Whether the plant emulates the robot."""
        section = self.robot.get(robot, RobotSection())
        if section.emulated is not None:
            return section.emulated
        return self.is_ours(robot) or section.plant_bus is not None

    def fault_problem(self, fault: Fault, robot: str) -> str | None:
        """Why a fault can't act on a robot where this places it; None: it can."""
        if fault.PLACE == "process" and not self.runs_here(AGENT.process(robot)):
            return f"its controller isn't started by the run: {fault.kind} can't act on it"
        if fault.PLACE != "plant":
            return None
        if not self.emulates(robot):
            return f"isn't emulated: {fault.kind} can't act on it"
        if "wire" in fault.NEEDS and not self.is_ours(robot):
            return f"the timing of its bus isn't emulated: {fault.kind} can't act on it"
        return None

    def runs_here(self, role: str) -> bool:
        """Whether `fleetloop run` starts this role."""
        return self.roles is None or role in self.roles

    def elsewhere(self, scenario: Scenario) -> tuple[str, ...]:
        """The roles that `fleetloop run` doesn't start here."""
        return tuple(role for role in processes_of(scenario.names) if not self.runs_here(role))


def load_deployment(path: Path, scenario: Scenario) -> Deployment:
    """Load a deployment file and check it against its scenario; its files are beside it.

    Raises:
        ScenarioError: it can't be read, or all that is wrong with it, a line each.
    """
    try:
        data = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioError(f"{path}: can't be read: {reason}") from error
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{path}: not a TOML file: {error}") from error
    return check_deployment(str(path), data, scenario, path.parent)


def check_deployment(
    name: str, data: dict[str, Any], scenario: Scenario, folder: Path
) -> Deployment:
    """A deployment from parsed TOML; `name` stands for the file in messages.

    Raises:
        ScenarioError: all that is wrong with it, a line each.
    """
    try:
        deployment = Deployment.model_validate(as_tuples(data))
    except ValidationError as error:
        found = complaints(error, data, Deployment)
        raise refusal([Complaint(name, *problem) for problem in found]) from error
    if found := _problems(deployment, scenario):
        raise refusal([Complaint(name, *problem) for problem in found])
    return _beside(deployment, folder)


def _settings(robot: str, bus: BusSection) -> Settings:
    return tuple(sorted({"channel": robot, **bus.model_dump(exclude_none=True)}.items()))


# --- check ----------------------------------------------------------------------------------------


def _problems(deployment: Deployment, scenario: Scenario) -> list[Problem]:
    roles = processes_of(scenario.names)
    identities = {identity_of(role) for role in roles} | {role.name for role in ROLES}
    problems = [
        Problem("roles", role, f"no such role; known: {', '.join(roles)}")
        for role in deployment.roles or ()
        if role not in roles
    ]
    for role in STARTED:
        if role.beside_launcher and not deployment.runs_here(role.name):
            remedy = f"must name {role.name}: it works where `fleetloop run` is"
            problems.append(Problem("roles", list(deployment.roles or ()), remedy))
    if deployment.elsewhere(scenario) and deployment.network is None:
        remedy = f"must be given: {', '.join(deployment.elsewhere(scenario))} come from elsewhere"
        problems.append(Problem("network", MISSING, remedy))
    realtime = scenario.clock.mode == "realtime"
    if deployment.roles is not None and deployment.elsewhere(scenario) and not realtime:
        remedy = 'roles elsewhere need clock.mode = "realtime"; add --clock realtime'
        problems.append(Problem("roles", list(deployment.roles), remedy))
    for user, buses in (deployment.network.guests if deployment.network else {}).items():
        problems += [
            Problem(f"network.guests.{user}", bus, f"no such bus: {', '.join(scenario.buses)} or *")
            for bus in buses
            if bus not in (*scenario.buses, "*")
        ]
        if user in identities or user.startswith(f"{AGENT.name}-"):
            problems.append(Problem(f"network.guests.{user}", user, "is a role's name"))
    problems += _network_problems(deployment.network)
    problems += [
        Problem(f"robot.{robot}", robot, reason)
        for fault in scenario.fault
        for robot in targets_of(fault, scenario)
        if (reason := deployment.fault_problem(fault, robot)) is not None
    ]
    places: dict[tuple[object, object], str] = {}
    for robot, section in deployment.robot.items():
        key = f"robot.{robot}"
        if robot not in scenario.names:
            remedy = f"no such robot; known: {', '.join(scenario.names)}"
            problems.append(Problem(key, robot, remedy))
            continue
        problems += _bus_problems(f"{key}.bus", section.bus, realtime=realtime)
        problems += _emulation_problems(key, section)
        bus = section.bus
        other = places.setdefault((bus.interface, bus.channel or robot), robot)
        if other != robot:
            remedy = f"{other} is there with the same node ids; give each robot a bus of its own"
            problems.append(Problem(f"{key}.bus.channel", bus.channel, remedy))
    return problems


def _network_problems(network: NetworkSection | None) -> list[Problem]:
    if network is None or (network.tls is None and network.certificates is None):
        return []
    problems = []
    if network.external and network.tls is not None:
        remedy = "an external router knows all roles: give network.certificates or network.users"
        problems.append(Problem("network.tls", str(network.tls.certificate), remedy))
    problems += [
        Problem(f"network.{name}", at, "must be tls/HOST:PORT: certificates are of no use over tcp")
        for name, at in (("endpoint", network.endpoint), ("listen", network.listen))
        if at is not None and not at.startswith("tls/")
    ]
    if network.tls is not None and network.certificates is not None:
        remedy = "leave out network.tls or network.certificates"
        problems.append(Problem("network.certificates", str(network.certificates), remedy))
    return problems


def _bus_problems(key: str, bus: BusSection, *, realtime: bool) -> list[Problem]:
    problems = [
        Problem(f"{key}.{name}", value, "must be a text, a number, true or false")
        for name, value in (bus.model_extra or {}).items()
        if not isinstance(value, str | int | float | bool)
    ]
    if bus.interface == OURS:
        return problems
    if bus.channel is None:
        remedy = f"must be given: what the interface {bus.interface} opens"
        problems.append(Problem(f"{key}.channel", MISSING, remedy))
    if not realtime:
        remedy = (
            'in lockstep the plant holds the bus: "fleetloop"; or run with --clock realtime'
            " at a rate and with gains for it"
        )
        problems.append(Problem(f"{key}.interface", bus.interface, remedy))
    return problems


def _emulation_problems(key: str, section: RobotSection) -> list[Problem]:
    problems = []
    ours = section.bus.interface == OURS
    plant = section.plant_bus
    if section.emulated is False and (ours or plant is not None):
        why = (
            "a bus of the interface fleetloop has emulated drives" if ours else "plant_bus says so"
        )
        problems.append(Problem(f"{key}.emulated", False, f"must be true: {why}"))
    if plant is not None and OURS in (section.bus.interface, plant.interface):
        remedy = "both ends must be on interfaces other than fleetloop, whose bus the plant holds"
        problems.append(Problem(f"{key}.plant_bus.interface", plant.interface, remedy))
    elif plant is not None:
        problems += _bus_problems(f"{key}.plant_bus", plant, realtime=True)
    return problems


def _beside(deployment: Deployment, folder: Path) -> Deployment:
    """The same with the files that it names found from its own folder."""
    network = deployment.network
    if network is None:
        return deployment
    changes: dict[str, Any] = {}
    if network.users is not None:
        changes["users"] = folder / expanded(network.users, "network.users")
    if network.certificates is not None:
        path = expanded(network.certificates, "network.certificates")
        changes["certificates"] = folder / path
    if network.tls is not None:
        files = {
            file.name: folder
            / expanded(getattr(network.tls, file.name), f"network.tls.{file.name}")
            for file in fields(network.tls)
        }
        changes["tls"] = replace(network.tls, **files)
    return deployment.model_copy(update={"network": replace(network, **changes)})
