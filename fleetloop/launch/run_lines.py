"""What happens in a run, as lines of JSON: see `docs/json-lines.md`."""

from collections.abc import Callable, Sequence

from bridge.network.messages import Progress
from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.events import Event
from configs.resolve import schedule
from configs.roles import short_name
from configs.scenario import Scenario
from fleetloop.json_lines import JsonLines
from fleetloop.launch.conduct import Listener, Start
from fleetloop.robot_states import RobotState

PICTURE_EVERY_S = 0.5
"""Shortest time between two of the lines that say how far the run is."""


class RunLines:
    """Says what a `Listener` of a run hears."""

    def __init__(
        self, lines: JsonLines, scenario: Scenario, *, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self._lines = lines
        self._scenario = scenario
        self._period_s = schedule(scenario).period_s
        self._clock = clock
        self._next_s = 0.0
        self._robots: Callable[[], Sequence[RobotState]] = lambda: ()

    @property
    def listener(self) -> Listener:
        """To be told of the run."""
        return Listener(self._on_progress, self._on_event, self.note, self._on_start)

    def note(self, source: str, text: str) -> None:
        """Something in words."""
        self._lines.say("note", source=short_name(source), text=text)

    def _on_start(self, start: Start) -> None:
        scenario, self._robots = self._scenario, start.robots
        self._lines.say(
            "started",
            command="run",
            scenario=scenario.name,
            folder=str(start.folder),
            run=start.run or None,
            processes=list(start.processes),
            robots=list(scenario.names),
            clock=scenario.clock.mode,
            period_s=self._period_s,
            ends_at_s=scenario.ends_at_s,
        )

    def _on_progress(self, state: Progress) -> None:
        if (now_s := self._clock.monotonic_s()) < self._next_s:
            return
        self._next_s = now_s + PICTURE_EVERY_S
        t_s, wall_s = round(state.t_ns * 1e-9, 9), round(state.wall_ns * 1e-9, 6)
        factor = t_s / wall_s if t_s > 0 < wall_s else None
        self._lines.picture(
            "progress", tick=state.tick, t_s=t_s, wall_s=wall_s, real_time_factor=factor
        )
        robots = {robot.robot: robot.as_dict() for robot in self._robots()}
        self._lines.picture("robots", tick=state.tick, t_s=t_s, robots=robots)

    def _on_event(self, event: Event) -> None:
        tick, source, kind, text = event
        t_s = round(tick * self._period_s, 9)
        self._lines.say("event", tick=tick, t_s=t_s, source=source, event=kind, text=text)
