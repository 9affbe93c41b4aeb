"""The scenario file as a type: everything that the processes of one run have to agree on.

`configs.loading.load` reads and checks a file; it isn't checked again. A scenario defines *what* a
run is; a deployment defines where its processes and buses are.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from annotated_types import Len
from pydantic import BaseModel, ConfigDict, Field

from configs.choices import chosen_anew, shared_part
from configs.drives import Drive
from configs.edges import FOREVER, LEADER, Edge, parse_edge, presence
from configs.emulated_edges import effects_to
from configs.expect import Expect
from configs.faults.kinds import AnyFault
from configs.faults.messages import LinkFault, PoseOutage
from configs.faults.plan import faulted_sources
from configs.graph import Graph, generated, of_matrix, random_rooted
from configs.graph_section import GraphSection
from configs.host import Host
from configs.membership import Membership, attended
from configs.netem import Effects
from configs.origin import Origin
from configs.parameters import Name, Seconds, Seed, changed
from configs.paths import Cosine, PathShape
from configs.plugins import Choice
from configs.powertrain import Encoder, Motor, Supply
from configs.reach import Reach, reach_of
from configs.sections import (
    LAW,
    PROTOCOL,
    Body,
    Bus,
    Clock,
    Control,
    Coordination,
    Disturbance,
    DriveChoice,
    Leader,
    Localisation,
    Mounting,
    Network,
    Recording,
    Robot,
)
from configs.switching import switched

ETSRO = "etsro"
"""The robot type that every scenario knows: the paper's."""


class Scenario(BaseModel):
    """One experiment."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    name: Name
    description: str = ""
    duration_s: Seconds = 30.0
    until_s: Seconds | None = Field(
        None,
        description="end this run here, not at duration_s, as --duration does: what is expected"
        " later stays unchecked",
    )
    seed: Seed = 1
    clock: Clock = Clock()
    path: PathShape = Cosine(kind="cosine", start_m=(-3.5, 0.0))
    leader: Leader = Leader()
    graph: GraphSection = GraphSection(generator="chain")
    control: Control = Field(default_factory=lambda: LAW.choose({}, ""))
    coordination: Coordination = Coordination()
    localisation: Localisation = Localisation()
    bus: Bus = Bus()
    drive_choice: DriveChoice = Field(
        default_factory=lambda: PROTOCOL.choose({}, ""), alias="drive"
    )
    motor: Motor = Motor()
    encoder: Encoder = Encoder()
    supply: Supply = Supply()
    mounting: Mounting = Mounting()
    host: Host = Host()
    disturbance: Disturbance = Disturbance()
    network: Network = Network()
    record: Recording = Recording()
    robot_types: dict[Name, Body] = Field(default_factory=dict)
    robot: Annotated[tuple[Robot, ...], Len(1, 256)]
    fault: Annotated[tuple[AnyFault, ...], Len(0, 1000)] = ()
    expect: tuple[Expect, ...] = ()

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with these sections instead of its own; what was made of the old ones goes."""
        copied = super().model_copy(update=update, deep=deep)
        if update:
            for made in copied.__dict__.keys() - type(self).model_fields.keys():
                del copied.__dict__[made]
        return copied

    @cached_property
    def origin(self) -> Origin | None:
        """The file that this was loaded from; None if it wasn't, or was changed since."""
        return None

    def originating(self, origin: Origin) -> Self:
        """This scenario, told where it is from: no field, so scenarios are equal without it."""
        self.__dict__["origin"] = origin
        return self

    def with_(
        self, changes: Mapping[str, object] | None = None, /, **sections: object
    ) -> "Scenario":
        """A scenario that differs from this one, checked as its file is.

            scenario.with_(control={"k1": 3.0}, until_s=5.0)
            scenario.with_({"coordination.p": 3.0, "robot.r2.pose.x_m": -6.5})
            scenario.with_(robot={"r2": {"pose": {"x_m": -6.5}}})

        Args:
            changes: keys of the file, dotted; members of lists by name or number.
            sections: the same as keyword arguments. A table is changed key by key (one of another
                `kind` replaces it), anything else is replaced, None takes a key away.

        Raises:
            ScenarioError: all that is wrong with it: key, value, what would be right.
        """
        from configs.loading import changed as changed_scenario

        if not isinstance(changes, Mapping | None):
            raise TypeError(f"with_({changes!r}): keys and values, as {{'control.k1': 3.0}}")
        return changed_scenario(self, [*(changes or {}).items(), *sections.items()])

    def to_toml(self) -> str:
        """The text of a scenario file that says all of this, defaults too."""
        from configs.loading import to_toml

        return to_toml(self)

    def __repr_args__(self) -> Iterable[tuple[str | None, object]]:
        """What tells scenarios apart; all of it is in `to_toml`."""
        yield None, self.name
        yield "robots", len(self.robot)
        yield "law", self.control.name
        yield "until_s", self.ends_at_s
        yield "clock", self.clock.mode
        yield "seed", self.seed

    @property
    def ends_at_s(self) -> float:
        """Scenario time at which the run ends."""
        return self.duration_s if self.until_s is None else self.until_s

    @property
    def drive(self) -> Drive:
        """Section [drive]; of a record whose protocol isn't here the shared keys."""
        return shared_part(Drive, self.drive_choice.parameters)

    def aged(self, name: str) -> tuple[str, ...]:
        """Sources of a robot whose ages are recorded.

        All its in-neighbours, where ages vary; the leader and the localisation system, where their
        edges are emulated.
        """
        if not self.ages_vary:
            return ()
        others = effects_to(
            self.network,
            self.topology,
            name,
            faulted=faulted_sources(self, name),
            of_robots=False,
        )
        return (*(edge.speaker for edge in self.topology.hears[name]), *others)

    @property
    def records_inputs(self) -> bool:
        """Whether the inputs of the controllers are recorded."""
        chosen = self.record.inputs
        return self.clock.mode == "realtime" if chosen is None else chosen

    @cached_property
    def ages_vary(self) -> bool:
        """Whether path states have other ages than the schedule's."""
        emulated = self.network.default != Effects() or bool(self.network.edge)
        emulated |= any(isinstance(fault, LinkFault | PoseOutage) for fault in self.fault)
        return emulated or self.clock.mode == "realtime" or self.topology.switches

    @property
    def names(self) -> tuple[str, ...]:
        """The robots, in the order of the file."""
        return tuple(robot.name for robot in self.robot)

    @property
    def buses(self) -> tuple[str, ...]:
        """All buses, in the order of their first robots."""
        return tuple(dict.fromkeys(self.bus_of(robot) for robot in self.names))

    def bus_of(self, name: str) -> str:
        """The bus of a robot."""
        robot = next(robot for robot in self.robot if robot.name == name)
        return robot.bus or robot.name

    def nodes_of(self, name: str) -> tuple[int, int]:
        """(right, left) node of a robot's drives: on a shared bus each robot has the next two."""
        robot = next(robot for robot in self.robot if robot.name == name)
        bus = robot.bus or name
        number = [one.name for one in self.robot if (one.bus or one.name) == bus].index(name)
        right, left = robot.right_node, robot.left_node
        step = 2 * number
        return (
            self.drive.right_node + step if right is None else right,
            self.drive.left_node + step if left is None else left,
        )

    @cached_property
    def members(self) -> dict[str, Membership]:
        """When each robot is part of the formation."""
        period_s = self.clock.control_period_s
        return {
            robot.name: Membership(
                joins_tick=round(robot.joins_at_s / period_s),
                leaves_tick=FOREVER
                if robot.leaves_at_s is None
                else round(robot.leaves_at_s / period_s),
            )
            for robot in self.robot
        }

    @cached_property
    def topology(self) -> Graph:
        """The directed graph with its weights, its generator and its switching carried out."""
        graph, names = self.graph, self.names
        weights = self._weights()
        longest_s = max(self.duration_s, self.ends_at_s)
        windows = attended(
            switched(self.first_edges, graph.switch, names, self.clock.control_period_s, longest_s),
            self.members,
        )
        made = Graph.of(
            names,
            [edge for edge in windows if edge[0] != LEADER],
            [hearer for speaker, hearer in windows if speaker == LEADER],
            weights,
            windows,
        )
        return made.normalised() if graph.weights == "normalised" else made

    @cached_property
    def reach(self) -> Reach:
        """Bounds of the path variables and speed estimates of a run."""
        coordination, leader, graph = self.coordination, self.leader, self.topology
        period_s = self.clock.control_period_s
        ticks = round(self.ends_at_s / period_s)
        presences = [(edge, *presence(edge.windows, ticks)) for edge in graph.in_edges]
        return reach_of(
            [robot.s_0 for robot in self.robot],
            [coordination.v_hat_0, leader.speed_m_s, *(step.speed_m_s for step in leader.steps)],
            mu_0=coordination.mu_0,
            p=coordination.p,
            q=coordination.q,
            max_in_degree=graph.max_in_degree,
            least_weight=min((edge.weight * there for edge, there, _ in presences), default=1.0),
            longest_absence_s=max((gone for *_, gone in presences), default=0) * period_s,
        )

    def body_of(self, robot: Robot) -> Body:
        """The body of a robot: its type's, with what the robot says differently."""
        kind = self.robot_types.get(robot.type, Body())
        return changed(kind, robot.body)

    def control_of(self, robot: Robot) -> Choice:
        """The law and gains of a robot: the fleet's, with what the robot says differently.

        Raises:
            ValidationError: what it says is wrong; not of a scenario that was checked.
        """
        return chosen_anew(self.control, LAW, robot.control)

    def mounting_of(self, robot: Robot) -> Mounting:
        """How a robot's drives are mounted: the fleet's, with what the robot says differently."""
        return changed(self.mounting, robot.mounting)

    @property
    def first_edges(self) -> tuple[Edge, ...]:
        """Edges and leader links of [graph]: before it switches."""
        links = self.graph.leader if self.graph.leader is not None else self.names[:1]
        return tuple(dict.fromkeys([*self._edges(), *((LEADER, robot) for robot in links)]))

    def _weights(self) -> dict[Edge, float]:
        table = self.graph.weights
        if self.graph.adjacency is not None:
            return of_matrix(self.names, self.graph.adjacency)
        if isinstance(table, str):
            return {}
        return {edge: a for text, a in table.items() if (edge := parse_edge(text)) is not None}

    def _edges(self) -> Sequence[Edge]:
        graph = self.graph
        if graph.adjacency is not None:
            return list(of_matrix(self.names, graph.adjacency))
        if graph.edges is not None:
            return [edge for text in graph.edges if (edge := parse_edge(text)) is not None]
        if graph.generator == "random":
            return random_rooted(self.names, max_in_degree=graph.max_in_degree, seed=graph.seed)
        return generated(graph.generator or "chain", self.names)
