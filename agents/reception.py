"""Received messages of one robot, from their admission until they are due.

    lockstep      a path state is due at its tick, a pose `pose_delay_ticks` after its own
    real time     what has arrived; of poses the newest
    emulated      after that, when the emulated edge delivers it (`agents.emulated_network`)

A path state over an edge that doesn't exist at its tick is discarded unseen. In lockstep a robot
may be silent at a tick: then nothing of it is due. A controller that re-joins in lockstep is given
poses from its first tick on, and of other robots what is dated beyond the lookahead: whatever was
said before it listened is older than that, and is discarded should it arrive.
"""

from collections.abc import Sequence
from typing import Any

from agents.admission import Admission
from agents.emulated_network import HERE, EmulatedNetwork
from agents.in_edges import InEdges
from agents.neighbours import Neighbours
from bridge.netem.channel import Channel
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from configs.brief import LEAD_TICKS, AgentBrief
from configs.leader_speed import SpeedChange, speed_at, with_change
from configs.reach import Reach
from configs.ticks import Ticks


class Reception:
    """What one robot has received. Pure."""

    def __init__(self, brief: AgentBrief) -> None:
        self._brief = brief
        self._schedule = brief.schedule
        self._ticks = Ticks(brief.schedule)
        self._realtime = brief.schedule.realtime
        self._period_ns = brief.schedule.period_ns
        self._rejoins = brief.rejoins
        self._follows_leader = brief.leader_link is not None
        self.admission = Admission(brief)
        """Plausibility of received messages, and the count of refused ones."""
        self.network = EmulatedNetwork(brief) if brief.channels else None
        """The emulated edges to this robot; None if none has effects."""
        self.neighbours = Neighbours(brief.hears, brief.coordination, brief.schedule.period_s)
        self.edges = InEdges(brief.hears, brief.leader_link, self.neighbours)
        self.start_fix: PoseFix | None = None
        self.leader: LeaderSpeed | None = None
        self._fixes: dict[int, PoseFix] = {}  # by tick, until due
        self._path_states: dict[int, dict[str, PathState]] = {}  # by tick, until due
        self._fix_tick = -1  # of the newest fix of the emulated network
        self._silent: dict[int, set[str]] = {}  # by tick, until due
        self._resumes_tick, self._listens_tick = brief.resumes_tick, 0
        if brief.rejoins and not self._realtime:
            # A robot at most `LEAD_TICKS` ahead has published the path state of the tick after.
            self._listens_tick = brief.resumes_tick + LEAD_TICKS + 2
        self._unspoken = set()  # in-neighbours of whose silences nothing was heard yet
        if brief.schedule.on_late != "abort":
            self._unspoken = {edge.speaker for edge in brief.hears}
        self._awaited = {e.speaker for e in brief.hears if e.exists(0) or not self._realtime}

    def receive_pose(self, fix: PoseFix) -> None:
        """Store a pose from the localisation system; ticks below 0: the start pose."""
        if self._too_old(fix.tick, self._resumes_tick) or not self.admission.admits_pose(fix):
            return
        if fix.tick < 0:
            self.start_fix = fix
        else:
            self._fixes[fix.tick] = fix
        if self.network is not None:
            self.network.receive_place(HERE, fix)

    def receive_place(self, robot: str, fix: PoseFix) -> None:
        """Store the pose of an in-neighbour for the emulated network; the controller has no use."""
        if self._too_old(fix.tick, self._listens_tick):
            return
        if self.network is not None and self.admission.admits_pose(fix, robot):
            self.network.receive_place(robot, fix)

    def receive_path_state(self, robot: str, state: PathState) -> None:
        """Store the path state of an in-neighbour; ticks below 0: its start value."""
        too_old = self._too_old(state.tick, self._listens_tick)
        if too_old or not self.edges.exists(robot, state.tick):  # discarded unseen
            self._awaited.discard(robot)
            return
        if not self.admission.admits_path_state(robot, state):
            return
        self._awaited.discard(robot)
        if state.tick < 0 or self._realtime:
            self._hand_on(robot, state)
        else:
            self._path_states.setdefault(state.tick, {})[robot] = state

    def receive_silence(self, robot: str, tick: int) -> None:
        """Note that an in-neighbour has no path state at a tick; below 0: only that it is said."""
        self._unspoken.discard(robot)
        if tick < 0 or self._too_old(tick, self._listens_tick):
            return
        if self.admission.admits_silence(robot, tick):
            self._silent.setdefault(tick, set()).add(robot)

    def _too_old(self, tick: int, first: int) -> bool:
        """Whether a message was said before a controller that re-joins listened."""
        return self._rejoins and tick < first

    def receive_leader_speed(self, speed: LeaderSpeed) -> None:
        """Store the virtual leader's speed profile."""
        if self.admission.admits_leader_speed(speed):
            self.leader = speed

    def knows_leader_speed(self, change: SpeedChange) -> bool:
        """Whether an ordered change of v_r, which may act later than ordered, is there already."""
        known = () if self.leader is None else self.leader.changes
        wanted = (change.speed_m_s, change.ramp_ns)
        return any(it.from_ns >= change.from_ns and it[1:] == wanted for it in known)

    def change_leader_speed(self, change: SpeedChange, reach: Reach) -> None:
        """Take an ordered change of v_r.

        Args:
            change: from a tick on that hasn't come.
            reach: of a scenario with this change, in which neighbours' messages are believed.
        """
        if self.leader is not None:
            self.leader = LeaderSpeed(tuple(with_change(self.leader.changes, change)))
        self.admission.reach = reach

    def channel_of(self, source: str, tick: int) -> Channel[Any]:
        """The emulated edge from a source; one without effects is made if there is none.

        What is under way over it arrives as before.
        """
        if self.network is None:
            self.network = EmulatedNetwork(self._brief)
        return self.network.channel(source) or self.network.open(source, tick, self.leader)

    def missing_to_start(self) -> list[str]:
        """Senders whose first message is required for the start and has not arrived."""
        if self._rejoins:  # the others have started
            return []
        missing = [f"the path variable of {robot}" for robot in sorted(self._awaited)]
        missing += [f"the plant's word of {robot}" for robot in sorted(self._unspoken)]
        if self.start_fix is None:
            missing.append("the localisation system")
        if self.leader is None and self._follows_leader:
            missing.append("the leader")
        return missing + (self.network.missing_to_start() if self.network is not None else [])

    def missing(self, tick: int) -> list[str]:
        """Messages that are due at this tick by the schedule and have not arrived."""
        schedule, missing = self._schedule, []
        pose_tick = tick - schedule.pose_delay_ticks
        owed = self._ticks.localises(pose_tick) and pose_tick >= self._resumes_tick
        if owed and pose_tick not in self._fixes:
            missing.append("pose")
        place_tick = tick - self._ticks.place_delay_ticks
        owed = self._ticks.localises(place_tick) and place_tick >= self._listens_tick
        if self.network is not None and owed:
            missing += self.network.missing(place_tick)
        if self._ticks.shares(tick) and tick >= self._listens_tick:
            heard, silent = self._path_states.get(tick, {}), self._silent.get(tick, ())
            missing += [
                f"path state of {r}"
                for r in self.edges.follow(tick)
                if r not in heard and r not in silent
            ]
        return missing

    def advance(self, tick: int) -> PoseFix | None:
        """Give the neighbours what is due at this tick; return the fix that is due, if any."""
        fixes: Sequence[PoseFix] = ()
        if self._realtime:
            if self._fixes:
                fixes = [self._fixes[number] for number in sorted(self._fixes)]
                self._fixes.clear()
        elif self._ticks.owes(tick):
            fixes = self._due(tick)
        if self.network is not None:
            return self._through(self.network, tick, fixes)
        return fixes[-1] if fixes else None

    def leader_speed(self, tick: int, without: float) -> float:
        """v_r as it is heard [m/s]; `without`: nothing heard over an emulated edge."""
        if self.network is not None:
            heard = self.edges.h > 0.0
            return self.network.leader_speed(tick, self.leader, without, exists=heard)
        if self.leader is None:
            return 0.0
        return speed_at(self.leader.changes, tick * self._period_ns)

    def ages_s(self, t_ns: int) -> list[float]:
        """Ages of the data of every source [s], in the order of the record; NaN: none yet."""
        ages = self.neighbours.ages_s(t_ns)
        return ages if self.network is None else ages + self.network.ages_s(t_ns)

    def _hand_on(self, robot: str, state: PathState) -> None:
        """Give a path state to the neighbours, or to its emulated edge if it has one."""
        if self.network is None or not self.network.carries_path_of(robot):
            self.neighbours.receive(robot, state.t_ns, state.s, state.v_hat)
        elif state.tick >= 0:  # what is said before the start is no message of the emulated network
            self.network.send_path_state(robot, state)

    def _due(self, tick: int) -> Sequence[PoseFix]:
        """In lockstep: what is due by the schedule, in the order of names, not of arrival."""
        self._silent.pop(tick, None)
        for robot, state in sorted(self._path_states.pop(tick, {}).items()):
            self._hand_on(robot, state)
        fix = self._fixes.pop(tick - self._schedule.pose_delay_ticks, None)
        return () if fix is None else (fix,)

    def _through(
        self, network: EmulatedNetwork, tick: int, fixes: Sequence[PoseFix]
    ) -> PoseFix | None:
        """What the emulated network delivers at this tick; fixes that it doesn't carry pass."""
        now_ns = tick * self._schedule.period_ns
        if network.carries_poses:
            for fix in fixes:
                network.send_pose(fix)
            fixes = ()
        network.measure(tick if self._realtime else tick - self._ticks.place_delay_ticks)
        for robot, state in network.path_states(now_ns, self.edges.heard):
            self.neighbours.receive(robot, state.t_ns, state.s, state.v_hat)
        newest = network.newest_pose(now_ns)
        if newest is None or newest.tick <= self._fix_tick:
            return fixes[-1] if fixes else None
        self._fix_tick = newest.tick
        return newest
