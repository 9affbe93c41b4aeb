"""The scenario file as a type: everything that the processes of one run have to agree on.

`configs.loading.load` reads and checks a file; it isn't checked again. A scenario defines *what* a
run is; a deployment defines where its processes and buses are.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from annotated_types import Len
from pydantic import BaseModel, ConfigDict, Field

from configs.choices import chosen_anew, shared_part
from configs.drives import Drive
from configs.edges import Edge, parse_edge
from configs.graph import Graph, generated, of_matrix, random_rooted
from configs.host import Host
from configs.netem import Effects
from configs.parameters import Name, Seconds, Seed, changed
from configs.paths import Cosine, PathShape
from configs.plugins import Choice
from configs.powertrain import Encoder, Motor, Supply
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
    Expect,
    GraphSection,
    Leader,
    Localisation,
    Mounting,
    Network,
    Robot,
)

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
    robot_types: dict[Name, Body] = Field(default_factory=dict)
    robot: Annotated[tuple[Robot, ...], Len(1, 256)]
    expect: tuple[Expect, ...] = ()

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with these sections instead of its own; what was made of the old ones goes."""
        copied = super().model_copy(update=update, deep=deep)
        copied.__dict__.pop("topology", None)
        return copied

    @property
    def ends_at_s(self) -> float:
        """Scenario time at which the run ends."""
        return self.duration_s if self.until_s is None else self.until_s

    @property
    def drive(self) -> Drive:
        """Section [drive]; of a record whose protocol isn't here the shared keys."""
        return shared_part(Drive, self.drive_choice.parameters)

    def aged(self, name: str) -> tuple[str, ...]:
        """In-neighbours of a robot whose ages are recorded: all, where ages vary."""
        emulated = self.network.default != Effects() or bool(self.network.edge)
        if not emulated and self.clock.mode == "lockstep":
            return ()
        return tuple(edge.speaker for edge in self.topology.hears[name])

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
    def topology(self) -> Graph:
        """The directed graph with its weights, its generator carried out."""
        graph, names = self.graph, self.names
        leader = graph.leader if graph.leader is not None else names[:1]
        if graph.adjacency is not None:
            weights = of_matrix(names, graph.adjacency)
            made = Graph.of(names, weights, leader, weights)
        else:
            made = Graph.of(names, self._edges(), leader, self._weights())
        return made.normalised() if graph.weights == "normalised" else made

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

    def _weights(self) -> dict[Edge, float]:
        table = self.graph.weights
        if isinstance(table, str):
            return {}
        return {edge: a for text, a in table.items() if (edge := parse_edge(text)) is not None}

    def _edges(self) -> Sequence[Edge]:
        graph = self.graph
        if graph.edges is not None:
            return [edge for text in graph.edges if (edge := parse_edge(text)) is not None]
        if graph.generator == "random":
            return random_rooted(self.names, max_in_degree=graph.max_in_degree, seed=graph.seed)
        return generated(graph.generator or "chain", self.names)
