"""Stands between the law and the drives: phases, faults, limits. The table is in `agents.agent`.

What the law asks for gets through whole, limited, or not at all; after arming again the law begins
anew. Torque is sent in one place, while the phase is DRIVING and nothing is wrong in that tick.
"""

from collections.abc import Callable, Sequence
from enum import Enum, auto
from math import isfinite
from typing import NamedTuple

from agents.limits import TorqueLimiter
from agents.rearming import Rearming
from bridge.drives import protocol
from bridge.drives.dry_run import DryRun
from bridge.drives.interface import DriveClient
from bridge.frame import Frame
from configs.brief import AgentBrief
from configs.errors import InfrastructureError

MAX_EVENTS = 64


class Phase(Enum):
    """What a controller is about."""

    ARMING = auto()
    READY = auto()
    DRIVING = auto()
    STOPPED = auto()
    REARMING = auto()
    DONE = auto()


class TorqueOutcome(Enum):
    """What became of the law's torques."""

    UNCHANGED = auto()
    LIMITED = auto()  # what the law would learn from this tick is the limit
    WITHHELD = auto()
    RESTARTED = auto()  # nothing, and the law begins again with the next tick


UNCHANGED = TorqueOutcome.UNCHANGED
_DRIVING = Phase.DRIVING


class Event(NamedTuple):
    """A change of phase that wasn't the plan."""

    when: str
    phase: Phase
    reason: str

    def __str__(self) -> str:
        """For people."""
        return f"{self.when}: {self.phase.name}{': ' if self.reason else ''}{self.reason}"


class Guard:
    """Keeps one robot's drives. Told everything, asks nothing."""

    def __init__(self, brief: AgentBrief) -> None:
        host, schedule = brief.host, brief.schedule
        client = protocol(brief.drives.protocol).client(brief.drives)
        self.drives: DriveClient = DryRun(client) if host.dry_run else client
        self.phase = Phase.ARMING
        self.begun = False
        """Whether tick 0 has come."""
        self.outcome = TorqueOutcome.WITHHELD
        """What became of the torques that the law asked for in this tick."""
        self.stop_tick = 0
        self.stop_reason = ""
        """Why the robot stands still now, "" if it doesn't."""
        self.events: list[Event] = []
        self.announce: Callable[[str], None] = lambda _: None
        """Told of each event as it happens, in words; whoever runs the controller says to whom."""
        self._announced: list[str] = []
        self.stalled = ""
        """Why the last ticks came late, "" if they didn't; see `note_stall`."""
        self.bus_fault: str | None = None
        """Why nothing can be sent; whoever sends says so."""
        self._brief = brief
        self._bus_time_ns = schedule.bus_time_ns
        self._when = schedule.when
        self._limiter = TorqueLimiter(
            host.torque_limit_wheel_N_m, host.torque_slew_limit_wheel_N_m_s, schedule.period_s
        )
        self._pose_age_ticks = -(-host.pose_age_limit_ns // schedule.period_ns)
        self._pose_until = self._pose_age_ticks if host.pose_age_limit_ns else schedule.ticks
        """The last tick that the newest fix is good for."""
        self._noted_faults: dict[str, str] = {}  # by sensor: why it isn't to be believed
        self._rearming = Rearming(host)
        self._refusal: str | None = None  # came while READY, and is a person's to clear

    # --- what is noticed elsewhere ---------------------------------------------------------------

    def note_pose(self, tick: int) -> None:
        """The localisation system said where the robot was at this tick."""
        if self._pose_age_ticks:
            self._pose_until = tick + self._pose_age_ticks

    def note_fault(self, sensor: str, reason: str | None) -> None:
        """Why a sensor isn't to be believed now, None if it is."""
        if reason is not None:
            self._noted_faults[sensor] = reason
        elif self._noted_faults:
            self._noted_faults.pop(sensor, None)

    def note_stall(self, tick: int, reason: str) -> None:
        """Why ticks come late from this one on; set `stalled` to "" when that is over."""
        self.stalled = reason
        if len(self._announced) < 2 * MAX_EVENTS:
            self._announce(f"{self._when(tick)}: {reason}")

    def note_unsent(self, tick: int) -> None:
        """The frames of this tick did not get onto the bus: arming has lost a step."""
        if not self.begun:
            self.phase = Phase.ARMING
            self.drives.disarm()
        elif self.phase is Phase.REARMING:
            self._stop(tick, "could not arm again: a frame of it was not sent")

    # --- before tick 0 ---------------------------------------------------------------------------

    def arm(self, tick: int) -> Sequence[Frame]:
        """On the way to closed loop, or waiting in it.

        Raises:
            InfrastructureError: the drives were not heard when control had to start.
        """
        if tick >= 0:
            self.begin(tick)
        drives, now_ns = self.drives, self._bus_time_ns(tick)
        if self._refusal is not None:
            return drives.rest(now_ns)
        if not drives.armed:
            return drives.arm(now_ns)
        if drives.fault(now_ns) is None:
            self.phase = Phase.READY
            return drives.torque(0.0, 0.0)
        self.phase = Phase.ARMING
        self._refusal = drives.refusal()
        return drives.disarm()

    def begin(self, tick: int) -> None:
        """Tick 0 has come.

        Raises:
            InfrastructureError: the drives were not armed when control had to start.
        """
        now_ns, drives = self._bus_time_ns(tick), self.drives
        reason = self._refusal or self.bus_fault or drives.fault(now_ns)
        if reason is None and self.phase is not Phase.READY:
            reason = drives.missing(now_ns) or "armed in the last tick only"
            reason += "; `fleetloop check` says whether bus and clock.countdown_s leave time for it"
        if reason is not None:
            raise InfrastructureError(
                f"{self._brief.robot}: drives not armed when control had to start: {reason}"
            )
        self.begun = True
        self.phase = _DRIVING

    # --- from tick 0 on --------------------------------------------------------------------------

    def command(
        self, tick: int, right_wheel_N_m: float, left_wheel_N_m: float, trouble: str = ""
    ) -> Sequence[Frame]:
        """The frames of a tick at which the law asks for these torques [N·m]; see `outcome`.

        `trouble` says why it asks for none that are finite, if more is known than that.
        """
        drives, now_ns = self.drives, self._bus_time_ns(tick)
        self.outcome = TorqueOutcome.WITHHELD
        if self.phase is not _DRIVING:
            return self._recover(tick, now_ns)
        fault = drives.fault(now_ns)
        if fault is None and (tick > self._pose_until or self._noted_faults or self.bus_fault):
            fault = self._own_fault(tick)
        if fault is None and not isfinite(right_wheel_N_m + left_wheel_N_m):
            fault = trouble or "the law asks for a torque that is not finite"
        if fault is not None:
            return self._stop(tick, fault)
        self.outcome = UNCHANGED
        if self._limiter.active:
            limited = self._limiter(right_wheel_N_m, left_wheel_N_m)
            if limited != (right_wheel_N_m, left_wheel_N_m):
                self.outcome = TorqueOutcome.LIMITED
            return drives.torque(*limited)
        return drives.torque(right_wheel_N_m, left_wheel_N_m)

    def shut_down(self) -> Sequence[Frame]:
        """Disarm for good; latched at the drives if the scenario wants that."""
        self.phase = Phase.DONE
        frames = self.drives.disarm()
        if self._brief.host.on_exit == "estop":
            return [*frames, *self.drives.estop()]
        return frames

    def notices(self) -> list[str]:
        """What a report should say beside the numbers, in words."""
        dry = ["dry run: nothing was sent to the drives"] if self._brief.host.dry_run else []
        return [*dry, *self._announced, *self.drives.notices]

    def _own_fault(self, tick: int) -> str | None:
        """What is wrong beside the drives, None if nothing is."""
        if self.bus_fault:
            return self.bus_fault
        if tick > self._pose_until:
            age = tick - self._pose_until + self._pose_age_ticks
            age_s = age * self._brief.schedule.period_s
            return f"no pose from the localisation system for {age_s:.2f} s"
        return next(iter(self._noted_faults.values()), None)

    def _stop(self, tick: int, reason: str) -> Sequence[Frame]:
        """Take the torque from both wheels."""
        if self.stalled:
            reason = f"{self.stalled}: {reason}"
        self.stop_tick = tick
        self.stop_reason = f"{self._when(tick)}: {reason}"
        self._change(tick, Phase.STOPPED, reason)
        return self.drives.disarm()

    def _recover(self, tick: int, now_ns: int) -> Sequence[Frame]:
        """Wait until nothing stands in the way; then the whole way of arming, to torque 0."""
        drives, rearming = self.drives, self._rearming
        if self.phase is Phase.STOPPED:
            if rearming.exhausted or not rearming.may_begin(self._obstacle(tick, now_ns), now_ns):
                return drives.rest(now_ns)
            self._change(tick, Phase.REARMING, "")
            return drives.disarm()
        obstacle = self._obstacle(tick, now_ns)
        if obstacle is None and not drives.armed and rearming.timed_out(now_ns):
            obstacle = f"could not arm again: {drives.missing(now_ns)}"
        if obstacle is not None:
            return self._stop(tick, obstacle)
        if not drives.armed:
            return drives.arm(now_ns)
        self._limiter.reset()
        self.outcome = TorqueOutcome.RESTARTED
        self.stop_reason = ""
        self._change(tick, _DRIVING, "armed again")
        return drives.torque(0.0, 0.0)

    def _obstacle(self, tick: int, now_ns: int) -> str | None:
        return self.drives.obstacle(now_ns) or self._own_fault(tick)

    def _change(self, tick: int, phase: Phase, reason: str) -> None:
        self.phase = phase
        if len(self.events) < MAX_EVENTS:
            event = Event(self._when(tick), phase, reason)
            self.events.append(event)
            self._announce(str(event))

    def _announce(self, text: str) -> None:
        self._announced.append(text)
        self.announce(text)
