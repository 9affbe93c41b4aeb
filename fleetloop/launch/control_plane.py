"""The launcher's end of the control plane: tokens, progress, notices and reports.

Every message changes the account of the run (`Outcome`), the signs of life (`Vitals`) and the
picture of the roles on other machines (`RemoteRoles`); `MessageReader`
counts what is malformed.
"""

from collections.abc import Callable, Iterable, Sequence

from bridge.network import keys
from bridge.network.link import Arrival, Link
from bridge.network.messages import Progress
from configs.brief import Schedule
from configs.events import Event, EventLog
from configs.roles import AGENT, PLANT, is_observer, short_name
from fleetloop.launch.child import Child
from fleetloop.launch.clock_offsets import ClockOffsets
from fleetloop.launch.machine import WATCH_EVERY_S
from fleetloop.launch.message_reader import MessageReader
from fleetloop.launch.outcome import Outcome
from fleetloop.launch.remote_roles import RemoteRoles
from fleetloop.launch.vitals import Vitals
from fleetloop.robot_states import RobotBoard, RobotState


class ControlPlane:
    """Takes the messages of one run.

    Args:
        schedule: of the run: what a progress message may say.
        remote: the roles on other machines.
        board: keeps what is to be seen of the robots.
        now: seconds on the launcher's clock of awake time.
        on_progress: called with the plant's progress.
        on_event: called with each event, as they come.
        on_notice: called with a process and what else is to be said of it at once.
    """

    def __init__(
        self,
        schedule: Schedule,
        remote: RemoteRoles,
        board: RobotBoard,
        now: Callable[[], float],
        on_progress: Callable[[Progress], None],
        on_event: Callable[[Event], None],
        on_notice: Callable[[str, str], None],
    ) -> None:
        self.outcome = Outcome()
        self.words = MessageReader(schedule)
        self.clocks = ClockOffsets(remote.processes)
        self.vitals = Vitals()
        self.remote = remote
        self._board = board
        self.children: list[Child] = []
        self.alive: set[str] = set()
        """Processes with a liveliness token."""
        self.held: set[str] = set()
        """Controllers that others don't wait for at present: frozen by a fault, or late."""
        self.let_go: set[str] = set()
        """Controllers that the run goes on without: killed by a fault, or dropped by the plant."""
        self.awaited: dict[str, int] = {}
        """Controllers that the plant waits for to be started again, and the ticks of that."""
        self.struck: dict[str, Event] = {}
        """Controllers that a fault has killed or frozen, and the event."""
        self.ticking = False
        """Whether the plant has begun to tick."""
        self.now = now
        self._on_progress = on_progress
        self._on_event = on_event
        self.on_notice = on_notice
        self.on_answer: Callable[[str, bytes], bool] = lambda *_: False
        """Called with a process and its answer to an order; returns whether it is well formed."""
        self.on_alive: Callable[[str], None] = lambda _: None
        """Called with a process that is there, or there again."""

    def subscribe(self, link: Link, run: str, processes: Iterable[str]) -> None:
        """Subscribe to the messages of these processes."""
        self.clocks.open(link, run)
        # One by one: a wildcard is wider than any identity's rights and would be refused.
        for process in processes:
            link.watch_live(keys.live(run, process), "live")
            link.subscribe(keys.progress(run, process), "progress")
            link.subscribe(keys.notice(run, process), "notice")
            link.subscribe(keys.report(run, process), "report")

    def receive(self, link: Link, within_s: float) -> None:
        """Take the next message, waiting at most so long [s]."""
        if (arrival := link.receive(within_s)) is not None:
            self.process(arrival)

    def settle(self, link: Link, children: Sequence[Child], within_s: float) -> list[Child]:
        """Take messages until these have ended, at most so long [s]; return those that haven't."""
        deadline = self.now() + within_s
        while left := [child for child in children if not child.ended()]:
            left_s = deadline - self.now()
            if left_s <= 0.0:
                break
            self.receive(link, min(left_s, WATCH_EVERY_S))
        return left

    def child(self, process: str) -> Child | None:
        """The process of that name on this machine, None if it is on another."""
        return next((child for child in self.children if child.name == process), None)

    @property
    def absent(self) -> set[str]:
        """Controllers that are killed, frozen, late or dropped."""
        return self.held | self.let_go | self.struck.keys()

    def lost_controllers(self) -> set[str]:
        """Controllers that are gone without having said so: their last rows will not come."""
        return (self.let_go | self.held) - self.struck.keys()

    @property
    def actors(self) -> list[Child]:
        """The processes on this machine that take part in the run."""
        return [
            child
            for child in self.children
            if not is_observer(child.name) and child.name not in self.let_go
        ]

    def note(self, process: str, kind: str, text: str, tick: int | None = None) -> None:
        """Record an event of a process that the launcher has observed, now or at a tick."""
        now = self.outcome.ticks if tick is None else tick
        event = Event(now, short_name(process), kind, text)
        self._take(self.outcome.events.setdefault(process, EventLog()), event)

    def process(self, arrival: Arrival) -> None:
        """Take one message."""
        process = keys.process_of(arrival.key)
        match arrival.tag:
            case "live":
                there = arrival.payload == b"1"
                (self.alive.add if there else self.alive.discard)(process)
                if there:
                    self.on_alive(process)
                away_s = self.remote.note_token(process, self.now(), there=there)
                if away_s is not None:
                    self.note(process, "back", f"there again after {away_s:.1f} s")
            case "progress":
                if (progress := self.words.progress(process, arrival.payload)) is not None:
                    self._process_progress(process, progress)
            case "pong":
                if not self.clocks.take(process, arrival.payload):
                    self.words.refusals.note("time", process, "not well formed")
            case "answer":
                if not self.on_answer(process, arrival.payload):
                    self.words.refusals.note("answer", process, "not well formed")
            case "notice":
                if (event := self.words.event(process, arrival.payload)) is not None:
                    self._note_absence(process, event)
                    self._take(self.outcome.said.setdefault(process, EventLog()), event)
            case _:
                self._process_report(process, arrival.payload)

    def _process_progress(self, process: str, progress: Progress) -> None:
        silence = self.vitals.beat(process, progress.tick, self.now())
        if silence is not None:
            self.note(process, "back", f"goes on after {silence.lasted_s:.1f} s")
        self._board.note(process, progress)
        if process == PLANT.name:
            self.ticking = True
            self.outcome.ticks = progress.tick
            self.outcome.wall_s = progress.wall_ns * 1e-9
            self._on_progress(progress)

    def robots(self) -> list[RobotState]:
        """What is to be seen of each robot now, in the order of the scenario."""
        controllers = {AGENT.process(robot) for robot in self._board.robots}
        gone = controllers - self.alive - self.outcome.reports.keys() if self.ticking else set()
        absent = dict.fromkeys(self.held, "held") | dict.fromkeys(gone | self.let_go, "absent")
        return self._board.states({short_name(process): it for process, it in absent.items()})

    def _process_report(self, process: str, payload: bytes) -> None:
        if (report := self.words.report(process, payload)) is not None:
            self.vitals.end(process)
            self.outcome.reports[process] = report
            self.remote.note_report(process, report)
            if report.left_early and self.outcome.ended == "completed":
                self.on_notice(process, f"left the run early: {report.left_early}")
        if (child := self.child(process)) is not None:
            child.release()

    def _note_absence(self, process: str, event: Event) -> None:
        """Take what plant or controller say of a controller's absence."""
        role, controller = process.partition("/")[0], AGENT.process(event.source)
        match role, event.kind:
            case AGENT.name, "killed" | "frozen":
                (self.held.add if event.kind == "frozen" else lambda _: None)(process)
                self.struck[process] = event
                if (child := self.child(process)) is not None:
                    child.release()
            case PLANT.name, "held":
                self.held.add(controller)
            case PLANT.name, "dropped":
                self.let_go.add(controller)
            case PLANT.name, "awaited":
                self.awaited[controller] = event.tick
            case PLANT.name, "back":
                self.held.discard(controller)
                self.struck.pop(controller, None)

    def _take(self, account: EventLog, event: Event) -> None:
        if account.take(event):
            self._on_event(event)
