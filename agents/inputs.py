"""A controller that logs its inputs, and the way back: a log that is fed to a controller.

    LoggedAgent   an `Agent` whose every input is in its log before, its answer after it took effect
    feed          one input of a log, to an agent of another process, on another day

An agent is a function of its inputs, so the fed one says what the logged one said, bit for bit, as
long as its code, and its law's, is the same. Start messages that repeat the last of their sender
change nothing and are logged once.
"""

from collections.abc import Sequence

from agents.agent import Agent, Trouble
from bridge.frame import Frame
from bridge.network.fault_orders import FaultOrder
from bridge.network.inputs import Input, InputBuffer, Kind
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from bridge.network.run_orders import LeaderOrder
from bridge.network.telemetry import RowBuffer
from configs.brief import AgentBrief
from configs.ticks import Ticks


class LoggedAgent(Agent):
    """A controller that logs its inputs."""

    def __init__(self, brief: AgentBrief, rows: RowBuffer, log: InputBuffer) -> None:
        super().__init__(brief, rows)
        self._log = log
        self._ticks = Ticks(brief.schedule)
        self._start_messages: dict[tuple[Kind, str], bytes] = {}
        log.begin(rejoins=brief.rejoins, resumes_tick=brief.resumes_tick)

    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """As `Agent.on_frame`."""
        self._log.frame(can_id, data, now_ns)
        super().on_frame(can_id, data, now_ns)

    def step(self, tick: int) -> Sequence[Frame]:
        """As `Agent.step`."""
        frames = super().step(tick)
        self._log.tick(tick, self._ticks.bus_time_ns(tick), frames)
        return frames

    def shut_down(self) -> Sequence[Frame]:
        """As `Agent.shut_down`."""
        frames = super().shut_down()
        self._log.stop(frames)
        return frames

    def end_at(self, tick: int) -> None:
        """As `Agent.end_at`."""
        self._log.about(Kind.CLOSING, tick)
        super().end_at(tick)

    def keep_time(self, now_ns: int, late_s: float, round_trip_s: float) -> None:
        """As `Agent.keep_time`."""
        self._log.clock(now_ns, late_s, round_trip_s)
        super().keep_time(now_ns, late_s, round_trip_s)

    def note_trouble(self, source: Trouble, text: str | None) -> None:
        """As `Agent.note_trouble`."""
        self._log.named(Kind.TROUBLE, source, (text or "").encode())
        super().note_trouble(source, text)

    def note_unsent(self, tick: int) -> None:
        """As `Agent.note_unsent`."""
        self._log.about(Kind.UNSENT, tick)
        super().note_unsent(tick)

    def take_order(self, order: FaultOrder, tick: int) -> int | str:
        """As `Agent.take_order`."""
        at = super().take_order(order, tick)
        if isinstance(at, int):
            self._log.named(Kind.ORDER, "", order._replace(from_tick=at, exact=True).encode())
        return at

    def take_leader_order(self, order: LeaderOrder, tick: int) -> int | str:
        """As `Agent.take_leader_order`."""
        at = super().take_leader_order(order, tick)
        if isinstance(at, int):
            self._log.named(Kind.LEADER_ORDER, "", order._replace(from_tick=at).encode())
        return at

    def receive_path_state(self, robot: str, state: PathState) -> None:
        """As `Agent.receive_path_state`."""
        self._log_message(Kind.PATH, robot, state.encode(), start=state.tick < 0)
        super().receive_path_state(robot, state)

    def receive_pose(self, fix: PoseFix) -> None:
        """As `Agent.receive_pose`."""
        self._log_message(Kind.POSE, "", fix.encode(), start=fix.tick < 0)
        super().receive_pose(fix)

    def receive_place(self, robot: str, fix: PoseFix) -> None:
        """As `Agent.receive_place`."""
        self._log_message(Kind.PLACE, robot, fix.encode(), start=fix.tick < 0)
        super().receive_place(robot, fix)

    def receive_leader_speed(self, speed: LeaderSpeed) -> None:
        """As `Agent.receive_leader_speed`."""
        self._log_message(Kind.LEADER, "", speed.encode(), start=True)
        super().receive_leader_speed(speed)

    def _log_message(self, kind: Kind, source: str, content: bytes, *, start: bool) -> None:
        if start:
            if self._start_messages.get((kind, source)) == content:
                return
            self._start_messages[kind, source] = content
        self._log.named(kind, source, content)


def feed(agent: Agent, entry: Input) -> Sequence[Frame]:
    """Give an agent one input; return the frames that it sends, none but after TICK and STOP.

    Raises:
        InfrastructureError: as `Agent.step`.
        ValueError: a message in it doesn't decode; so for a KeyError: of a robot that isn't heard.
    """
    match entry.kind:
        case Kind.FRAME:
            frame = entry.frame()
            agent.on_frame(frame.can_id, frame.data, entry.time_ns)
        case Kind.TICK:
            return agent.step(entry.tick())
        case Kind.CLOCK:
            agent.keep_time(*entry.clock())
        case Kind.STOP:
            return agent.shut_down()
        case Kind.CLOSING:
            agent.end_at(entry.tick())
        case Kind.UNSENT:
            agent.note_unsent(entry.tick())
        case Kind.TROUBLE:
            source, text = entry.named()
            agent.note_trouble(Trouble(source), text.decode() or None)
        case Kind.BEGIN:
            pass
        case _:
            _deliver(agent, entry)
    return ()


def _deliver(agent: Agent, entry: Input) -> None:
    source, content = entry.named()
    match entry.kind:
        case Kind.PATH if (state := PathState.decode(content)) is not None:
            agent.receive_path_state(source, state)
        case Kind.POSE if (fix := PoseFix.decode(content)) is not None:
            agent.receive_pose(fix)
        case Kind.PLACE if (fix := PoseFix.decode(content)) is not None:
            agent.receive_place(source, fix)
        case Kind.LEADER if (speed := LeaderSpeed.decode(content)) is not None:
            agent.receive_leader_speed(speed)
        case Kind.ORDER if (order := FaultOrder.decode(content)) is not None:
            agent.take_order(order, order.from_tick)
        case Kind.LEADER_ORDER if (change := LeaderOrder.decode(content)) is not None:
            agent.take_leader_order(change, change.from_tick)
        case _:
            raise ValueError(f"a {entry.kind.name} of {source or 'no robot'} doesn't decode")
