"""The emulated edges to one robot: received messages go through them before the controller's use.

The real messages have travelled over Zenoh and were admitted; here they are delayed, lost,
duplicated or reordered as the scenario's [network] says (`bridge.netem`), by scenario time, so a
run in lockstep stays exact. In real time a message is due at its date plus the emulated delay, or
when it really arrives, if that is later.

The leader's speed profile is one message. Its emulated edge carries v_r at every share instead, and
the last speed that arrived is held.
"""

from collections.abc import Mapping
from math import nan

from bridge.netem.channel import Channel
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from configs.brief import AgentBrief
from configs.edges import LEADER
from configs.netem import LOCALISATION


class EmulatedNetwork:
    """The channels of one robot; sources without effects have none."""

    __slots__ = ("_fixes", "_leader", "_paths", "_schedule", "_silence_ns", "_v_r", "_v_r_ns")

    def __init__(self, brief: AgentBrief) -> None:
        age_limit_ns = round(brief.coordination.age_limit_s * 1e9)
        self._paths: dict[str, Channel[PathState]] = {}
        self._leader: Channel[float] | None = None
        self._fixes: Channel[PoseFix] | None = None
        for model in sorted(brief.channels, key=lambda model: model.source):
            match model.source:
                case source if source == LEADER:
                    self._leader = Channel(model, model.seed, age_limit_ns)
                case source if source == LOCALISATION:
                    self._fixes = Channel(model, model.seed, age_limit_ns)
                case robot:
                    self._paths[robot] = Channel(model, model.seed, age_limit_ns)
        self._schedule = brief.schedule
        self._silence_ns = round(brief.coordination.silence_limit_s * 1e9)
        self._v_r, self._v_r_ns = nan, 0

    def carries_path_of(self, robot: str) -> bool:
        """Whether the path states of a robot go through a channel."""
        return robot in self._paths

    @property
    def carries_poses(self) -> bool:
        """Whether poses go through a channel."""
        return self._fixes is not None

    def send_path_state(self, robot: str, state: PathState) -> None:
        """Hand a path state to its channel, at its date."""
        self._paths[robot].send(state.t_ns, state)

    def send_pose(self, fix: PoseFix) -> None:
        """Hand a pose to its channel, at its date."""
        if self._fixes is not None:
            self._fixes.send(fix.t_ns, fix)

    def path_states(self, now_ns: int) -> list[tuple[str, PathState]]:
        """The path states that are due, in the order of names."""
        return [
            (robot, delivery.message)
            for robot, channel in self._paths.items()
            for delivery in channel.receive(now_ns)
        ]

    def newest_pose(self, now_ns: int) -> PoseFix | None:
        """The newest of the poses that are due, None if none is."""
        if self._fixes is None:
            return None
        fixes = [delivery.message for delivery in self._fixes.receive(now_ns)]
        return max(fixes, key=lambda fix: fix.tick, default=None)

    def leader_speed(self, tick: int, leader: LeaderSpeed | None, without: float) -> float:
        """v_r at a tick as the robot hears it [m/s]; `without`: nothing heard, or not for long."""
        now_ns = tick * self._schedule.period_ns
        channel = self._leader
        if channel is None or leader is None:
            return without if leader is None else leader.speed_at(now_ns)
        if self._schedule.shares(tick):
            channel.send(now_ns, leader.speed_at(now_ns))
        for sent_ns, v_r in channel.receive(now_ns):
            if self._v_r != self._v_r or sent_ns >= self._v_r_ns:
                self._v_r, self._v_r_ns = v_r, sent_ns
        heard = self._v_r == self._v_r and now_ns - self._v_r_ns <= self._silence_ns
        return self._v_r if heard else without

    def counts(self) -> dict[str, Mapping[str, int]]:
        """Messages by source."""
        channels: dict[str, Channel[PathState] | Channel[float] | Channel[PoseFix]] = {
            **self._paths
        }
        if self._leader is not None:
            channels[LEADER] = self._leader
        if self._fixes is not None:
            channels[LOCALISATION] = self._fixes
        return {source: channel.counts.as_dict() for source, channel in channels.items()}
