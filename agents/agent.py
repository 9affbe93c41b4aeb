"""The controller of one robot, one control period at a time: sense, decide, act, share.

    phase      on                                                 to         frames
    ARMING     both drives in closed loop without error           READY      arming frames, torque 0
    ARMING     tick 0                                             error      -
    READY      a fault before tick 0                              ARMING     torque 0, idle
    READY      tick 0                                             DRIVING    torque 0
    DRIVING    a fault                                            STOPPED    the law's, limited
    STOPPED    no obstacle for `rearm_after`, and rearm allowed   REARMING   torque 0; idle
    REARMING   both drives in closed loop without error           DRIVING    arming frames, torque 0
    REARMING   an obstacle, or `rearm_limit`                      STOPPED    torque 0, idle
    any        the tick at which the robot leaves the formation   LEFT       torque 0, idle
    any        the closing tick, or told to stop                  DONE       torque 0, idle (estop)

A fault is a drive that drops out or falls silent, two senders of a drive's telemetry, a bus that
can't be sent on, a pose that is too old, sensors that disagree, or a law, a path or a path variable
beyond the reach of the scenario: it diverged, and its last value within reach is kept for the
neighbours. A fault takes the torque from both wheels in the same tick: the frames that report a
change of phase out of DRIVING are already torque 0. An obstacle is a fault that persists, less the
errors that a host may clear by itself; an error before tick 0 that a person must clear isn't
cleared again. After rearming the first set-point is 0, the limiter starts from 0 and the law from
its first tick.

A robot that joins late stands until then: in phase DRIVING, torque 0, its law not called. It
listens, and so that nothing jumps for the others it takes its path variable from what it hears
(`agents.joining`). A controller that was started again begins STOPPED, with one attempt to arm, and
joins as one that is late. A stopped robot goes on sharing its path variable, so that its neighbours
aren't cut off. A dry run goes through the same phases without a frame.

One class: it is the order in which its parts, in modules of their own, act within a period.
"""

from collections.abc import Sequence
from enum import StrEnum
from math import hypot, inf, isfinite, nan
from typing import Any, Final

from agents.coordination import CoordinationState, Coordinator
from agents.emulated_network import EmulatedNetwork
from agents.faults import MessageFaults
from agents.guard import UNCHANGED, Guard, Phase, TorqueOutcome
from agents.joining import Joining
from agents.laws.build import build
from agents.laws.failure import DIVERGED, failure
from agents.laws.interface import PathVariable, Reference, RobotMotion
from agents.limits import EncoderCheck
from agents.localisation import Localiser
from agents.paths import robot_path
from agents.reception import Reception
from bridge.frame import Frame
from bridge.netem.channel import Channel
from bridge.network.fault_orders import FaultOrder
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from bridge.network.run_orders import LeaderOrder, order_tick
from bridge.network.telemetry import RowBuffer
from configs.brief import AgentBrief
from configs.netem import LOCALISATION, MOST_DELAY_NS
from configs.reach import beyond
from configs.signals import AGE_PREFIX

_NOWHERE: Final = RobotMotion(nan, nan, nan, nan, nan)
_NO_REFERENCE: Final = Reference(nan, nan, nan, nan, nan)
POSE_HISTORY_TICKS: Final = 64
"""Longest age of a fix in real time [ticks]."""


class Trouble(StrEnum):
    """What a loop knows of the world around a controller that goes wrong for a while."""

    BUS = "bus"  # sends fail
    LAUNCHER = "launcher"  # the way to it is cut
    MACHINE = "machine"  # ticks are late


class Agent:
    """The controller of one robot. Pure: frames, messages and ticks in, frames out.

    What its methods are given is all that it depends on: `agents.inputs` logs and repeats it.
    """

    def __init__(self, brief: AgentBrief, rows: RowBuffer) -> None:
        self.brief = brief
        self.rows = rows
        """Of the record."""
        self._schedule = brief.schedule
        self._h, self._period_ns = brief.schedule.period_s, brief.schedule.period_ns
        self.guard = self._guard = Guard(brief)
        """Phases, faults and limits between the law and the drives."""
        self._drives = self._guard.drives
        self._path = robot_path(brief.path, brief.offset)
        self._tick = 0  # of the law
        law = build(brief.law, brief.wheels, self._h, self._path, self._note)
        self._law_name = brief.law.name
        self._law_step, self._law_hold = law.step, law.hold
        self._no_signals = (nan,) * law.signals
        self._law_state: Any = None  # the law's own
        self._reception = reception = Reception(brief)
        self.admission = reception.admission
        """Plausibility of received messages, and the count of refused ones."""
        self.missing_to_start = reception.missing_to_start
        """Senders whose first message is required for the start and has not arrived."""
        self.missing = reception.missing
        """Messages that are due at a tick and have not arrived."""
        self.faults = MessageFaults(brief, self._channel_of, self._guard.note)
        """Faults of the messages to this robot."""
        self.neighbours = reception.neighbours.heard
        """The in-neighbours whose edges exist, and how old what they said last is [s]."""
        self._neighbours, self._edges = reception.neighbours, reception.edges
        self._history = self._pose_history(brief)
        self._localiser = Localiser(brief.localisation, brief.wheels, self._history)
        self._coordinator = Coordinator(brief.coordination, self._h)
        start = brief.coordination
        self._coordination = CoordinationState(start.v_hat_0, start.mu_0, brief.s_0)
        self._joining = Joining(
            brief, self._neighbours, self._edges, self._coordinator, self._coordination
        )
        self._leaves = brief.membership.leaves_tick
        self._located = self._diverged = False  # by a fix; the next path variable is beyond reach
        self._records_ages = any(signal.name.startswith(AGE_PREFIX) for signal in brief.signals)
        self._encoder_check = EncoderCheck(brief.host.encoder_mismatch_limit_wheel_rad, self._h)
        fused = brief.localisation == "fused"
        self._pose_mismatch_m = brief.host.pose_mismatch_limit_m if fused else inf
        self.last_tick = brief.schedule.ticks
        """The closing tick of the scenario, or of a run that ends before it."""
        self.closed = False
        """Whether the closing tick has come."""
        self.late_s = self.round_trip_s = 0.0
        """Lateness and feedback round trip at this tick [s], for the record."""

    def _pose_history(self, brief: AgentBrief) -> int:
        """Longest age of a fix [ticks]: the odometry since then is kept for that long."""
        if self.network is not None and self.network.carries_poses:
            oldest = min(brief.host.pose_age_limit_ns, MOST_DELAY_NS) // brief.schedule.period_ns
            return max(oldest, POSE_HISTORY_TICKS, brief.schedule.pose_delay_ticks)
        return POSE_HISTORY_TICKS if brief.schedule.realtime else brief.schedule.pose_delay_ticks

    def _channel_of(self, source: str, tick: int) -> Channel[Any]:
        """The emulated edge from a source, made now for a fault that wasn't foreseen."""
        channel = self._reception.channel_of(source, tick)
        if source == LOCALISATION:
            self._history = self._pose_history(self.brief)
            self._localiser.remember(self._history)
        return channel

    @property
    def network(self) -> EmulatedNetwork | None:
        """The emulated edges to this robot; None if none has effects."""
        return self._reception.network

    @property
    def row(self) -> Sequence[float]:
        """The values of `brief.signals` at the last tick; empty before there is one."""
        return self.rows.newest

    @property
    def phase(self) -> Phase:
        """The phase of the controller."""
        return self._guard.phase

    def refusals(self) -> list[str]:
        """Refused messages, in words."""
        return self.admission.refusals.lines()

    def remarks(self) -> list[str]:
        """Remarks on the whole run for the report, in words."""
        return [*self._guard.remarks(), *self.refusals()]

    # --- what is received --------------------------------------------------------------------

    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """Process a frame from the bus, received at a bus time [ns]."""
        self._drives.on_frame(can_id, data, now_ns)

    def feedback_since(self, bus_ns: int) -> bool:
        """Whether both encoder frames were received after a bus time [ns]."""
        return self._drives.feedback_since(bus_ns)

    def receive_pose(self, fix: PoseFix) -> None:
        """Store a pose from the localisation system."""
        self._reception.receive_pose(fix)

    def receive_place(self, robot: str, fix: PoseFix) -> None:
        """Store the pose of an in-neighbour, for the emulated network."""
        self._reception.receive_place(robot, fix)

    def receive_path_state(self, robot: str, state: PathState) -> None:
        """Store the path state of an in-neighbour."""
        self._reception.receive_path_state(robot, state)

    def receive_silence(self, robot: str, tick: int) -> None:
        """Note that an in-neighbour has no path state at a tick."""
        self._reception.receive_silence(robot, tick)

    def receive_leader_speed(self, speed: LeaderSpeed) -> None:
        """Store the virtual leader's speed profile."""
        self._reception.receive_leader_speed(speed)

    # --- notes of the loop in real time ------------------------------------------------------

    def end_at(self, tick: int) -> None:
        """Close a run at this tick that ends before its scenario."""
        self.last_tick = tick

    def keep_time(self, now_ns: int, late_s: float, round_trip_s: float) -> None:
        """Take the wall clock before a tick.

        Args:
            now_ns: scenario time by the wall clock.
            late_s: from the tick's due time to its computation.
            round_trip_s: from the last torques sent to their feedback; NaN: it has not come.
        """
        self.admission.now_ns = now_ns
        self.late_s, self.round_trip_s = late_s, round_trip_s

    def note_trouble(self, source: Trouble, text: str | None) -> None:
        """Note a trouble around the controller; None: it is over."""
        match source:
            case Trouble.BUS:
                self._guard.bus_fault = text
            case Trouble.LAUNCHER:
                self._guard.note_fault("launcher", text)
            case Trouble.MACHINE:
                self._guard.stalled = text or ""

    def note_unsent(self, tick: int) -> None:
        """Note that the frames of this tick were not sent."""
        self._guard.note_unsent(tick)

    def take_order(self, order: FaultOrder, tick: int) -> int | str:
        """Take an order before a tick; return the tick at which it acts, or why it can't."""
        return self.faults.take(order, order.tick(tick, self.last_tick))

    def take_leader_order(self, order: LeaderOrder, tick: int) -> int | str:
        """Take an order of v_r before a tick; the tick from which on it acts, or why it can't.

        An order that is repeated only brings its reach.
        """
        ordered = order.change(order.from_tick, self._schedule.period_ns)
        if self._reception.knows_leader_speed(ordered):
            self._reception.admission.reach = order.reach
            return order.from_tick
        acts = order_tick(order.from_tick, tick, self.last_tick, exact=order.exact)
        if not isinstance(acts, str):
            change = order.change(acts, self._schedule.period_ns)
            self._reception.change_leader_speed(change, order.reach)
        return acts

    # --- one period --------------------------------------------------------------------------

    def share(self, tick: int) -> PathState:
        """The path state for the out-neighbours at this tick; known after the tick before."""
        now = self._coordination
        return PathState(tick, tick * self._schedule.period_ns, now.s, now.v_hat)

    def step(self, tick: int) -> Sequence[Frame]:
        """Compute one tick; return the frames for the bus.

        Raises:
            InfrastructureError: the drives were not armed when control had to start.
        """
        self.admission.tick = tick
        self._edges.follow(tick)
        self.faults.begin(tick)
        wheel_motion = self._drives.motion()
        if wheel_motion is None:
            return self._guard.arm(tick)
        right_rad, left_rad, right_rad_s, left_rad_s = wheel_motion
        motion = self._localiser.wheels(right_rad, left_rad, right_rad_s, left_rad_s)
        if self._encoder_check.active:
            self._guard.note_fault("encoders", self._encoder_check(wheel_motion))
        if tick <= 0:
            start = self._reception.start_fix
            if start is not None:
                motion = self._localiser.fix(start.x_m, start.y_m, start.theta_rad)
            if tick < 0:
                return self._guard.arm(tick)
        fix = self._reception.advance(tick)
        if fix is not None:
            motion = self._apply_fix(tick, fix, motion)
        if tick >= self.last_tick:
            self.closed = True
            return self._guard.shut_down()
        if not self._guard.begun:
            self._guard.begin(tick)
        if self._joining.joins <= tick < self._leaves:
            return self._control(tick, motion)
        return self._stand_by(tick, motion)

    def _apply_fix(self, tick: int, fix: PoseFix, carried: RobotMotion) -> RobotMotion:
        """Apply a fix at its own instant, unless its odometry is lost.

        `carried` is the motion without it.
        """
        ago = max(tick - fix.tick, 0)
        if ago > self._history:
            return carried
        try:
            motion = self._localiser.fix(fix.x_m, fix.y_m, fix.theta_rad, ago)
        except DIVERGED:  # beyond arithmetic: ignored
            return carried
        self._guard.note_pose(tick - ago)
        self._located = True
        if self._pose_mismatch_m < inf:
            apart_m = hypot(motion.x - carried.x, motion.y - carried.y)
            far = apart_m > self._pose_mismatch_m
            self._guard.note_fault(
                "pose", f"pose and odometry are {apart_m:.2g} m apart" if far else None
            )
        return motion

    def _control(self, tick: int, motion: RobotMotion) -> Sequence[Frame]:
        """The coordination and the law at one tick; where either diverges the robot stops."""
        t_ns = tick * self._period_ns
        self._tick = tick
        coordination = self._coordination
        v_hat, mu, s = coordination.v_hat, coordination.mu, coordination.s
        s_dot = mu + v_hat
        sums = self._neighbours.sums(t_ns, s)
        v_r = self._reception.leader_speed(tick, v_hat)
        after = self._coordinator.advance(coordination, sums, self._edges.h, v_r)
        along = PathVariable(s, s_dot, (after.v_hat + after.mu - s_dot) / self._h)
        guard = self._guard
        law_state: Any = None
        try:
            reference = self._path(s)
            out = self._law_step(self._law_state, motion, reference, along)
        except (Exception, SystemExit) as error:  # any end of a law or path stops this robot only
            reference, signals = _NO_REFERENCE, self._no_signals
            how, why = failure(error, self._law_name)
            frames = guard.command(tick, nan, nan, f"{how} at s = {s:.4g} m: {why}")
        else:
            law_state, signals = out.state, tuple(out.signals)
            frames = guard.command(tick, out.tau_right, out.tau_left)
        outcome = guard.outcome
        if outcome is UNCHANGED:
            self._law_state = law_state
        elif outcome is TorqueOutcome.LIMITED:
            self._law_state = self._law_hold(self._law_state, law_state)
        elif outcome is TorqueOutcome.RESTARTED:
            self._law_state = None
        self._accept_path_variable(t_ns * 1e-9 + self._h, after)
        rows = self.rows
        rows.begin(tick)
        rows.put(t_ns * 1e-9)
        self._put_motion(motion)
        rows.put(s)
        rows.put(s_dot)
        rows.put(mu)
        rows.put(v_hat)
        rows.put(sums.neighbours)
        rows.put(reference.x)
        rows.put(reference.y)
        rows.put(reference.theta)
        self._end_row(t_ns, signals)
        return frames

    def _stand_by(self, tick: int, motion: RobotMotion) -> Sequence[Frame]:
        """One tick before the robot joins the formation, or after it has left."""
        t_ns = tick * self._schedule.period_ns
        v_r = self._reception.leader_speed(tick, self._coordination.v_hat)
        if tick >= self._leaves:
            frames = self._guard.leave(tick)
        else:
            frames = self._guard.command(tick, 0.0, 0.0)
            after = self._joining.state(
                tick + 1, v_r, self._reception.leader, located=self._located
            )
            self._accept_path_variable(t_ns * 1e-9 + self._h, after)
            if tick + 1 == self._joining.joins:
                self._guard.note_joining(tick + 1, self._coordination.s)
        rows = self.rows
        rows.begin(tick)
        rows.put(t_ns * 1e-9)
        self._put_motion(motion if self._located or not self.brief.rejoins else _NOWHERE)
        for value in (nan, nan, nan, nan, 0.0, nan, nan, nan):
            rows.put(value)
        self._end_row(t_ns, self._no_signals)
        return frames

    def _put_motion(self, motion: RobotMotion) -> None:
        """Its numbers of a row."""
        rows = self.rows
        rows.put(motion.x)
        rows.put(motion.y)
        rows.put(motion.theta)
        rows.put(motion.v)
        rows.put(motion.omega)

    def _end_row(self, t_ns: int, signals: tuple[float, ...]) -> None:
        """The numbers of a row from the ages of what was heard on, the law's among them."""
        rows = self.rows
        if self._records_ages:
            for age_s in self._reception.ages_s(t_ns):
                rows.put(age_s)
        for value in signals:
            rows.put(value)
        right_wheel_N_m, left_wheel_N_m = self._drives.sent_wheel_N_m
        rows.put(right_wheel_N_m)
        rows.put(left_wheel_N_m)
        rows.put(self.late_s)
        rows.put(self.round_trip_s)
        rows.end()

    def speaks(self, tick: int) -> bool:
        """Whether the robot is part of the formation, so that its path state means something."""
        return self._joining.joins <= tick < self._leaves

    def _accept_path_variable(self, t_s: float, after: CoordinationState) -> None:
        """Accept the next path variable; one beyond reach is rejected, and the robot stops."""
        mu = after.mu
        far = beyond(self.admission.reach, t_s, after.s, after.v_hat if isfinite(mu) else mu)
        if far is None:
            self._coordination = after
        if (far is None) is self._diverged:
            self._diverged = far is not None
            trouble = None if far is None else f"its path variable diverged: {far}"
            self._guard.note_fault("path variable", trouble)

    def _note(self, text: str) -> None:
        self._guard.note(self._tick, "law", text)

    def shut_down(self) -> Sequence[Frame]:
        """Disarm for good, on a stop before the closing tick."""
        return self._guard.shut_down()
