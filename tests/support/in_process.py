"""A scenario run in process, with its rows by robot and signal."""

from bridge.network.telemetry import PLANT_ROW, row_of
from bridge.process.lifecycle import Stop
from configs.connections import NetworkLink
from configs.events import Event
from configs.resolve import agent_brief, leader_brief, plant_brief, signals_of
from configs.scenario import Scenario
from configs.signals import PLANT_SIGNALS
from fleetloop.in_process.run import InProcessRun

NETWORK = NetworkLink("in-process", "", "", "")
Column = list[float]


class RanInProcess:
    """The rows and events of a scenario that has run to its end."""

    def __init__(self, scenario: Scenario) -> None:
        self.rows: dict[tuple[str, str], bytes] = {}
        """By robot and source."""
        self.events: list[Event] = []
        self._scenario = scenario
        self.run = InProcessRun(
            plant_brief(scenario, network=NETWORK),
            [agent_brief(scenario, robot, network=NETWORK, bus=()) for robot in scenario.names],
            leader_brief(scenario),
            self,
            lambda _: None,
            self.events.append,
        )
        self.run.run(Stop())

    def add(self, robot: str, source: str, _first_tick: int, rows: bytes) -> None:
        self.rows[robot, source] = self.rows.get((robot, source), b"") + rows

    def end(self, robot: str, source: str) -> None:
        pass

    def traffic(self, bus: str, frames: bytes) -> None:
        pass

    def truth(self, robot: str) -> dict[str, Column]:
        """The plant's signals by name."""
        names = [signal.name for signal in PLANT_SIGNALS]
        columns = zip(*PLANT_ROW.iter_unpack(self.rows[robot, "plant"]), strict=True)
        return dict(zip(names, map(list, columns), strict=True))

    def controller(self, robot: str) -> dict[str, Column]:
        """Its controller's signals by name."""
        of = next(one for one in self._scenario.robot if one.name == robot)
        signals = signals_of(self._scenario, of)
        columns = zip(*row_of(signals).iter_unpack(self.rows[robot, "controller"]), strict=True)
        return dict(zip([signal.name for signal in signals], map(list, columns), strict=True))

    def events_of(self, robot: str) -> list[str]:
        """Kinds of a robot's events, in order, without those of faults."""
        own = [event.kind for event in self.events if event.source == robot]
        return [kind for kind in own if not kind.startswith("fault")]

    def distance(self, robot: str) -> Column:
        """Distance of a robot from its reference at each tick [m]."""
        truth, used = self.truth(robot), self.controller(robot)
        return [
            ((x - x_d) ** 2 + (y - y_d) ** 2) ** 0.5
            for x, y, x_d, y_d in zip(
                truth["x_m"], truth["y_m"], used["x_d_m"], used["y_d_m"], strict=True
            )
        ]
