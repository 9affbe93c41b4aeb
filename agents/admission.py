"""Plausibility of received messages: a well-formed message can still be impossible.

    message       refused if
    path state    its time isn't its tick's, or the schedule shares nothing at that tick
                  lockstep: its tick is over, was received before, or is further ahead than a bus
                  may be
                  real time: dated more than `ahead_limit_s` ahead of now, older than
                  `silence_limit_s`, or not newer than the last one of its sender
                  s or v̂ are beyond the reach of the scenario (`configs.reach`)
    pose          its date, likewise; a position or heading beyond the reach of any scenario
    silence       its tick, likewise; in real time nobody says it
    leader speed  faster than the scenario allows

Ticks below 0 carry start values; they are ignored once control has begun, and late ones are not
counted up to a limit. A refused message is counted by its sender and changes nothing, so its sender
counts as silent: in lockstep the wait times out with its name, in real time it leaves the sums.
"""

from collections import Counter
from typing import Final

from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from bridge.network.refused_messages import Refusals
from configs.brief import LEAD_TICKS, AgentBrief
from configs.reach import beyond, too_fast, within_world
from configs.ticks import Ticks

LOCALISATION: Final = "the localisation system"
LEADER: Final = "the leader"
LATE_MESSAGES_TOLERATED: Final = 5000
"""Start messages of one sender that may arrive after control has begun; more are a flood."""
_AHEAD_TICKS: Final = LEAD_TICKS + 2
"""A path state is published a tick before it is due, and this robot may be between two ticks."""


class Admission:
    """Plausibility checks of one robot's messages. Reads no clock: `tick` and `now_ns` are set."""

    def __init__(self, brief: AgentBrief) -> None:
        schedule = brief.schedule
        self.refusals = Refusals()
        self.tick = -schedule.countdown_ticks - 1
        """The tick computed last."""
        if brief.rejoins and not schedule.realtime:
            self.tick = brief.resumes_tick - 1
        # One that is held finds everything that was said meanwhile when it goes on.
        self._ahead_ticks = schedule.ticks if schedule.on_late == "hold" else _AHEAD_TICKS
        self.now_ns = self.tick * schedule.period_ns
        """Scenario time [ns] by the wall clock; set by the loop in real time."""
        self._ticks = Ticks(schedule)
        self._realtime = schedule.realtime
        self._period_ns = schedule.period_ns
        self.reach = brief.reach
        """Of the scenario, and of what was ordered since."""
        self._delay_ticks = schedule.pose_delay_ticks
        self._ahead_ns = round(brief.coordination.ahead_limit_s * 1e9) + 2 * schedule.period_ns
        self._old_ns = round(brief.coordination.silence_limit_s * 1e9)
        self._newest_ns: dict[str, int] = {}
        self._late_count: Counter[str] = Counter()

    def admits_path_state(self, robot: str, state: PathState) -> bool:
        """Whether a path state is plausible; one that isn't is counted."""
        if state.tick < 0 <= self.tick:
            return self._late(robot)
        wrong = self._path_date(robot, state)
        if wrong is None and (far := beyond(self.reach, state.t_ns * 1e-9, state.s, state.v_hat)):
            wrong = "reach", far
        if wrong is not None:
            self.refusals.note("path state", robot, *wrong)
            return False
        if state.tick >= 0:
            self._newest_ns[robot] = state.t_ns
        return True

    def admits_pose(self, fix: PoseFix, robot: str = "") -> bool:
        """Whether a pose is plausible, of this robot or another; one that isn't is counted."""
        sender = f"{LOCALISATION}, of {robot}" if robot else LOCALISATION
        if fix.tick < 0 <= self.tick:
            return self._late(sender)
        delay_ticks = self._ticks.place_delay_ticks if robot else self._delay_ticks
        wrong = self._pose_date(fix, sender, delay_ticks)
        if wrong is None and not within_world(fix.x_m, fix.y_m, fix.theta_rad):
            wrong = "reach", f"({fix.x_m:.6g} m, {fix.y_m:.6g} m, {fix.theta_rad:.6g} rad)"
        if wrong is not None:
            self.refusals.note("pose", sender, *wrong)
            return False
        if fix.tick >= 0:
            self._newest_ns[sender] = fix.t_ns
        return True

    def admits_silence(self, robot: str, tick: int) -> bool:
        """Whether an in-neighbour can be silent at a tick; what is implausible is counted."""
        wrong: tuple[str, str] | None = None
        if self._realtime or not self._ticks.shares(tick):
            wrong = "tick", f"nothing is shared at tick {tick}"
        if wrong := wrong or self._due(tick):
            self.refusals.note("silence", robot, *wrong)
            return False
        return True

    def admits_leader_speed(self, speed: LeaderSpeed) -> bool:
        """Whether the leader's speed is plausible; one that isn't is counted."""
        for change in speed.changes:
            if far := too_fast(self.reach, change.speed_m_s, "v_r"):
                self.refusals.note("speed", LEADER, "reach", far)
                return False
        return True

    def _late(self, sender: str) -> bool:
        """Refuse a start message received after the start; beyond the limit it is a flood."""
        self._late_count[sender] += 1
        if self._late_count[sender] > LATE_MESSAGES_TOLERATED:
            self.refusals.note("message", sender, "start", "dated before the run, which goes on")
        return False

    def malformed(self, what: str, sender: str) -> None:
        """Count a message that doesn't decode."""
        self.refusals.note(what, sender, "not well formed")

    def _path_date(self, robot: str, state: PathState) -> tuple[str, str] | None:
        tick, t_ns = state.tick, state.t_ns
        if t_ns != tick * self._period_ns:
            return "time", f"tick {tick} is not at {t_ns * 1e-9:.6g} s"
        if tick < 0:
            return None
        if not self._ticks.shares(tick):
            return "tick", f"nothing is shared at tick {tick}"
        if self._realtime:
            return self._distance(t_ns) or self._order(t_ns, self._newest_ns.get(robot))
        return self._due(tick) or self._order(t_ns, self._newest_ns.get(robot))

    def _pose_date(self, fix: PoseFix, sender: str, delay_ticks: int) -> tuple[str, str] | None:
        tick, t_ns = fix.tick, fix.t_ns
        if tick < 0:
            return None
        if not 0 <= t_ns - tick * self._period_ns < self._period_ns:
            return "time", f"tick {tick} is not at {t_ns * 1e-9:.6g} s"
        if self._realtime:
            return self._distance(t_ns)
        if not self._ticks.localises(tick):
            return "tick", f"no pose is taken at tick {tick}"
        wrong = self._due(tick, delay_ticks)
        return wrong or self._order(t_ns, self._newest_ns.get(sender))

    def _due(self, tick: int, delay_ticks: int = 0) -> tuple[str, str] | None:
        """In lockstep: a reason if the tick is over or too far ahead, None otherwise."""
        ahead = tick - max(self.tick, -1)
        if ahead > self._ahead_ticks:
            return "ahead", f"dated {ahead * self._period_ns * 1e-9:.6g} s ahead"
        if ahead + delay_ticks <= 0:
            return "back", f"tick {tick} came when tick {self.tick} was over"
        return None

    def _distance(self, t_ns: int) -> tuple[str, str] | None:
        """In real time: a reason if the date is too far from now, None otherwise."""
        ahead_ns = t_ns - self.now_ns
        if ahead_ns > self._ahead_ns:
            return "ahead", f"dated {ahead_ns * 1e-9:.6g} s ahead"
        if -ahead_ns > self._old_ns:
            return "back", f"dated {-ahead_ns * 1e-9:.6g} s back"
        return None

    def _order(self, t_ns: int, newest_ns: int | None) -> tuple[str, str] | None:
        if newest_ns is None or t_ns > newest_ns:
            return None
        if t_ns == newest_ns:
            return "twice", f"that of {t_ns * 1e-9:.6g} s came twice"
        return "order", f"that of {t_ns * 1e-9:.6g} s came after that of {newest_ns * 1e-9:.6g} s"
