"""The emulated edges to one robot: received messages go through them before the controller's use.

The real messages have travelled over Zenoh and were admitted; here they are delayed, lost,
duplicated or reordered as the scenario's [network] says (`bridge.netem`), by scenario time, so a
run in lockstep stays exact. In real time a message is due at its date plus the emulated delay, or
when it really arrives, if that is later.

The leader's speed profile is one message. Its emulated edge carries v_r at every share instead, and
the last speed that arrived is held.

A source without effects gets a channel as soon as a fault that was ordered during the run concerns
its edge.

Where effects depend on the distance between two robots, the poses of the other one come here as
well, from the localisation system, and nowhere else: the controller doesn't know them. A message is
sent from as far as the robots were apart at the last poses that both have.
"""

from collections.abc import Collection, Mapping
from math import hypot, nan
from typing import Any, Final

from bridge.netem.channel import Channel
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from configs.brief import AgentBrief, ChannelModel
from configs.edges import LEADER
from configs.leader_speed import speed_at
from configs.netem import LOCALISATION
from configs.ticks import Ticks

HERE: Final = ""
"""This robot among those that have poses."""


class EmulatedNetwork:
    """The channels of one robot; sources without effects have none."""

    __slots__ = (
        "_age_limit_ns",
        "_aged",
        "_fix_ns",
        "_fixes",
        "_leader",
        "_located",
        "_paths",
        "_places",
        "_poses",
        "_schedule",
        "_seed_of",
        "_silence_ns",
        "_ticks",
        "_v_r",
        "_v_r_ns",
        "distances_m",
    )

    def __init__(self, brief: AgentBrief) -> None:
        self._age_limit_ns = round(brief.coordination.age_limit_s * 1e9)
        self._seed_of = brief.channel_seed
        self._paths: dict[str, Channel[PathState]] = {}
        self._leader: Channel[float] | None = None
        self._fixes: Channel[PoseFix] | None = None
        for model in sorted(brief.channels, key=lambda model: model.source):
            self._add(model)
        self._aged = frozenset(model.source for model in brief.channels)
        self._schedule = brief.schedule
        self._ticks = Ticks(brief.schedule)
        self._silence_ns = round(brief.coordination.silence_limit_s * 1e9)
        self._v_r, self._v_r_ns = nan, 0
        self._fix_ns: int | None = None  # of the newest pose that arrived
        self._located = brief.located
        self._poses: dict[int, dict[str, PoseFix]] = {}  # by tick, until due
        self._places: dict[str, PoseFix] = {}  # the newest of each robot
        self.distances_m = dict.fromkeys(brief.located, nan)
        """From this robot to in-neighbours, by their newest poses [m]; NaN: not known yet."""

    def _add(self, model: ChannelModel) -> Channel[Any]:
        channel: Channel[Any] = Channel(model, model.seed, self._age_limit_ns)
        match model.source:
            case source if source == LEADER:
                self._leader = channel
            case source if source == LOCALISATION:
                self._fixes = channel
            case robot:
                self._paths[robot] = channel
        return channel

    def channel(self, source: str) -> Channel[Any] | None:
        """The channel of a source, None if it has none."""
        return self._channels().get(source)

    def open(self, source: str, tick: int, leader: LeaderSpeed | None) -> Channel[Any]:
        """Give a source a channel without effects from a tick on.

        The leader's last speed over it is that of the last share, as if it had been there before.
        Its ages aren't recorded.
        """
        channel = self._add(ChannelModel(source=source, seed=self._seed_of(source)))
        self._paths = dict(sorted(self._paths.items()))
        if source == LEADER and leader is not None:
            every = self._schedule.share_every
            self._v_r_ns = max((tick - 1) // every * every, 0) * self._schedule.period_ns
            self._v_r = speed_at(leader.changes, self._v_r_ns)
        return channel

    def carries_path_of(self, robot: str) -> bool:
        """Whether the path states of a robot go through a channel."""
        return robot in self._paths

    @property
    def carries_poses(self) -> bool:
        """Whether poses go through a channel."""
        return self._fixes is not None

    def send_path_state(self, robot: str, state: PathState) -> None:
        """Hand a path state to its channel, at its date."""
        self._paths[robot].send(state.t_ns, state, self.distances_m.get(robot, 0.0))

    def send_pose(self, fix: PoseFix) -> None:
        """Hand a pose to its channel, at its date."""
        if self._fixes is not None:
            self._fixes.send(fix.t_ns, fix)

    def missing_to_start(self) -> list[str]:
        """Robots whose start pose has not arrived, though effects depend on their distance."""
        return [f"the pose of {robot}" for robot in self._located if robot not in self._places]

    def missing(self, tick: int) -> list[str]:
        """Robots whose pose of this tick has not arrived, though effects depend on it."""
        poses = self._poses.get(tick, {})
        return [f"pose of {robot}" for robot in self._located if robot not in poses]

    def receive_place(self, robot: str, fix: PoseFix) -> None:
        """Store the pose of an in-neighbour, or of this robot (`HERE`), until it is due.

        Start poses are due at once: the first path states are sent before the first tick.
        """
        if not self._located:
            return
        if fix.tick < 0:
            self._places[robot] = fix
            self._measure()
        else:
            self._poses.setdefault(fix.tick, {})[robot] = fix

    def measure(self, tick: int) -> None:
        """Measure the distances to in-neighbours by the newest poses up to this tick."""
        due = sorted(at for at in self._poses if at <= tick)
        for at in due:
            self._places |= self._poses.pop(at)
        if due:
            self._measure()

    def _measure(self) -> None:
        here = self._places.get(HERE)
        if here is None:
            return
        for robot in self._located:
            if (there := self._places.get(robot)) is not None:
                apart_m = hypot(there.x_m - here.x_m, there.y_m - here.y_m)
                self.distances_m[robot] = apart_m

    def path_states(self, now_ns: int, heard: Collection[str]) -> list[tuple[str, PathState]]:
        """The path states that are due, in the order of names; `heard`: whose edges exist."""
        return [
            (robot, delivery.message)
            for robot, channel in self._paths.items()
            for delivery in channel.receive(now_ns, exists=robot in heard)
        ]

    def newest_pose(self, now_ns: int) -> PoseFix | None:
        """The newest of the poses that are due, None if none is."""
        if self._fixes is None:
            return None
        fixes = [delivery.message for delivery in self._fixes.receive(now_ns)]
        newest = max(fixes, key=lambda fix: fix.tick, default=None)
        if newest is not None and (self._fix_ns is None or newest.t_ns > self._fix_ns):
            self._fix_ns = newest.t_ns
        return newest

    def leader_speed(
        self, tick: int, leader: LeaderSpeed | None, without: float, *, exists: bool = True
    ) -> float:
        """v_r at a tick as the robot hears it [m/s].

        `without` if nothing is heard, or not for long, or if the leader's edge doesn't exist.
        """
        now_ns = tick * self._schedule.period_ns
        channel = self._leader
        if channel is None or leader is None:
            return without if leader is None else speed_at(leader.changes, now_ns)
        if not exists:
            channel.receive(now_ns, exists=False)
            self._v_r = nan
            return without
        if self._ticks.shares(tick):
            channel.send(now_ns, speed_at(leader.changes, now_ns))
        for sent_ns, v_r in channel.receive(now_ns):
            if self._v_r != self._v_r or sent_ns >= self._v_r_ns:
                self._v_r, self._v_r_ns = v_r, sent_ns
        heard = self._v_r == self._v_r and now_ns - self._v_r_ns <= self._silence_ns
        return self._v_r if heard else without

    def ages_s(self, now_ns: int) -> list[float]:
        """Ages of the newest speed of the leader and the newest pose that arrived [s].

        Of those of the two that the scenario has a channel for; NaN: none has arrived.
        """
        ages = []
        if LEADER in self._aged:
            ages.append((now_ns - self._v_r_ns) * 1e-9 if self._v_r == self._v_r else nan)
        if LOCALISATION in self._aged:
            ages.append((now_ns - self._fix_ns) * 1e-9 if self._fix_ns is not None else nan)
        return ages

    def counts(self) -> dict[str, Mapping[str, int]]:
        """Messages by source."""
        return {source: channel.counts.as_dict() for source, channel in self._channels().items()}

    def _channels(self) -> dict[str, Channel[Any]]:
        channels: dict[str, Channel[Any]] = {**self._paths}
        if self._leader is not None:
            channels[LEADER] = self._leader
        if self._fixes is not None:
            channels[LOCALISATION] = self._fixes
        return channels
