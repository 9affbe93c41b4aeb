"""One robot's controller, one period at a time: sense, decide, act, share.

    phase      on                                          to        torque
    ARMING     both drives in closed loop without error    READY     0
    READY      tick 0                                      DRIVING   0
    ARMING     tick 0                                      error     -
    DRIVING    a drive drops out or falls silent           STOPPED   the law's
    DRIVING    the closing tick                            DONE      the law's
    STOPPED    the closing tick                            DONE      0, drives disarmed
    DONE       -                                           -         -

A stopped robot goes on sharing its path variable, so that its neighbours aren't cut off. An agent
knows only what arrived as a CAN frame or as a message; it never reads a clock.
"""

from collections.abc import Sequence
from enum import Enum, auto

from agents.coordination import CoordinationState, Coordinator
from agents.laws import LAWS, LawOutput, LawState, Sense
from agents.localisation import Localiser
from agents.neighbours import Neighbours
from agents.paths import robot_path
from bridge.drives import DRIVES
from bridge.frame import Frame
from bridge.messages import LeaderSpeed, PathState, PoseFix
from bridge.telemetry import RowBuffer
from configs.brief import AgentBrief
from configs.errors import InfrastructureError

POSE_HISTORY_TICKS = 64
"""In real time, a fix may be this old: the odometry since is known."""


class Phase(Enum):
    """What a controller is about."""

    ARMING = auto()
    READY = auto()
    DRIVING = auto()
    STOPPED = auto()
    DONE = auto()


class Agent:
    """The controller of one robot. Told everything, asks nothing."""

    def __init__(self, brief: AgentBrief, rows: RowBuffer) -> None:
        self.brief = brief
        self.phase = Phase.ARMING
        self.stopped_because = ""
        self._rows = rows
        self._schedule = brief.schedule
        self._h = brief.schedule.period_s
        self._drives = DRIVES[brief.drives.protocol].client(brief.drives)
        self._path = robot_path(brief.path, brief.offset)
        self._law = LAWS[brief.law](brief.gains, brief.wheels, self._h)
        self._law_state: LawState | None = None
        self._pose_delay = brief.schedule.pose_delay_ticks
        history = POSE_HISTORY_TICKS if brief.schedule.realtime else self._pose_delay
        self._localiser = Localiser(brief.localisation, brief.wheels, history)
        self._neighbours = Neighbours(
            brief.hears, brief.coordination, self._h, brief.schedule.share_every * self._h
        )
        self._coordinator = Coordinator(brief.coordination, self._h, brief.hears_leader)
        start = brief.coordination
        self._coordination = CoordinationState(start.v_hat_0, start.mu_0, start.s_0)
        self.heard_since = self._drives.heard_since
        """Whether both encoder frames came after a bus time [ns]."""
        self._leader: LeaderSpeed | None = None
        self._start_fix: PoseFix | None = None
        self._fixes: dict[int, PoseFix] = {}  # by tick, until due
        self._states: dict[int, dict[str, PathState]] = {}  # by tick, until due
        self._unheard = set(brief.hears)
        self._at_once = brief.schedule.realtime
        self.late_s = self.round_trip_s = 0.0
        """What the loop measured of the clock at this tick, for the record."""
        self.hear = self._drives.hear
        """Take one frame from the bus: identifier, data, bus time [ns] at which it came."""

    # --- what arrives ------------------------------------------------------------------------

    def take_pose(self, fix: PoseFix) -> None:
        """Take a pose from the localisation system; ticks below 0: where the robot starts."""
        if fix.tick < 0:
            self._start_fix = fix
        else:
            self._fixes[fix.tick] = fix

    def take_path(self, robot: str, state: PathState) -> None:
        """Take what an in-neighbour says of its path variable; ticks below 0: where it starts."""
        self._unheard.discard(robot)
        if state.tick < 0 or self._at_once:
            self._neighbours.hear(robot, state.t_ns, state.s, state.v_hat)
        else:
            self._states.setdefault(state.tick, {})[robot] = state

    def take_leader(self, speed: LeaderSpeed) -> None:
        """Take the virtual leader's speed, now and to come."""
        self._leader = speed

    def missing_to_start(self) -> list[str]:
        """Whom the robot has to hear before the run, and has not yet."""
        missing = [f"the path variable of {robot}" for robot in sorted(self._unheard)]
        if self._start_fix is None:
            missing.append("the localisation system")
        if self._leader is None and self.brief.hears_leader:
            missing.append("the leader")
        return missing

    def missing(self, tick: int) -> list[str]:
        """What the schedule says is due at this tick and has not arrived."""
        missing = []
        pose_tick = tick - self._pose_delay
        if self._schedule.localises(pose_tick) and pose_tick not in self._fixes:
            missing.append("pose")
        if self._schedule.shares(tick):
            heard = self._states.get(tick, {})
            missing += [f"path state of {r}" for r in self.brief.hears if r not in heard]
        return missing

    # --- one period --------------------------------------------------------------------------

    def share(self, tick: int) -> PathState:
        """What the out-neighbours hear at this tick; known as soon as the tick before is done."""
        v_hat, _, s = self._coordination
        return PathState(tick, tick * self._schedule.period_ns, s, v_hat)

    def step(self, tick: int) -> Sequence[Frame]:
        """Compute one tick; return the frames for the bus.

        Raises:
            InfrastructureError: the drives were not armed when control had to start.
        """
        motion = self._drives.motion()
        if motion is None:
            return self._arm(tick)
        sense = self._localiser.wheels(*motion)
        if tick <= 0:
            if self._start_fix is not None:
                start = self._start_fix
                sense = self._localiser.fix(start.x_m, start.y_m, start.theta_rad)
            if tick < 0:
                return self._arm(tick)
        if self._at_once:
            sense = self._take_newest(tick, sense)
        elif self._schedule.owes(tick):
            sense = self._take_due(tick, sense)
        if tick >= self._schedule.ticks:
            self.phase = Phase.DONE
            return self._drives.disarm()
        if self.phase is not Phase.DRIVING:
            self._begin(tick)
        return self._control(tick, sense)

    def _take_due(self, tick: int, sense: Sense) -> Sense:
        """Use what is due at this tick, in the order of names whatever the order of arrival."""
        for robot, state in sorted(self._states.pop(tick, {}).items()):
            self._neighbours.hear(robot, state.t_ns, state.s, state.v_hat)
        fix = self._fixes.pop(tick - self._pose_delay, None)
        if fix is None:
            return sense
        return self._localiser.fix(fix.x_m, fix.y_m, fix.theta_rad, self._pose_delay)

    def _take_newest(self, tick: int, sense: Sense) -> Sense:
        """In real time: use the newest fix, as old as it is, unless it is too old to place."""
        if not self._fixes:
            return sense
        fix = self._fixes[max(self._fixes)]
        self._fixes.clear()
        ago = max(tick - fix.tick, 0)
        if ago > POSE_HISTORY_TICKS:
            return sense
        return self._localiser.fix(fix.x_m, fix.y_m, fix.theta_rad, ago)

    def _arm(self, tick: int) -> Sequence[Frame]:
        bus_ns = self._schedule.bus_time_ns(tick)
        if self._drives.armed:
            self.phase = Phase.READY
            return self._drives.torque(0.0, 0.0)
        return self._drives.arm(bus_ns)

    def _begin(self, tick: int) -> None:
        if self.phase is Phase.STOPPED:
            return
        if self.phase is not Phase.READY or not self._drives.armed:
            fault = self._drives.fault(self._schedule.bus_time_ns(tick))
            raise InfrastructureError(
                f"{self.brief.robot}: drives not armed when control had to start:"
                f" {fault or 'no closed loop reported yet; a longer clock.countdown_s helps'}"
            )
        self.phase = Phase.DRIVING

    def _control(self, tick: int, sense: Sense) -> Sequence[Frame]:
        """Steps 1 to 11 of the law at one tick."""
        t_ns = tick * self._schedule.period_ns
        v_hat, mu, s = coordination = self._coordination
        s_dot = mu + v_hat
        reference = self._path(s)
        out = self._law(self._law_state, sense, reference, s_dot)
        frames = self._act(tick, out)
        n, sum_s, sum_v = self._neighbours.sums(t_ns)
        v_r = self._leader.at(t_ns) if self._leader is not None else 0.0
        self._coordination = self._coordinator.advance(coordination, n, sum_s, sum_v, v_r)
        self._rows.add(
            tick,
            (
                t_ns * 1e-9,
                *sense,
                s,
                s_dot,
                mu,
                v_hat,
                float(n),
                reference.x,
                reference.y,
                reference.theta,
                *out.signals,
                *self._drives.sent,
                self.late_s,
                self.round_trip_s,
            ),
        )
        return frames

    def _act(self, tick: int, out: LawOutput) -> Sequence[Frame]:
        """Torques while the drives are well; once one isn't, both wheels are stopped for good."""
        if self.phase is Phase.DRIVING:
            fault = self._drives.fault(self._schedule.bus_time_ns(tick))
            if fault is None:
                self._law_state = out.state
                return self._drives.torque(out.tau_right, out.tau_left)
            self.phase = Phase.STOPPED
            self.stopped_because = f"tick {tick}: {fault}"
        return self._drives.disarm()

    def leave(self) -> Sequence[Frame]:
        """Disarm for good: told to stop before the closing tick."""
        self.phase = Phase.DONE
        return self._drives.disarm()
