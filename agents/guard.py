"""Supervision between the law and the drives: phases, faults, limits; table in `agents.agent`.

The law's torques are sent unchanged, limited, or withheld; after rearming the law restarts from its
first tick. Torque is sent in one place only, in phase DRIVING and in a tick without a fault.
"""

from collections.abc import Callable, Sequence
from enum import Enum, auto
from math import isfinite
from typing import Final

from agents.limits import TorqueLimiter
from agents.rearming import Rearming
from bridge.drives.dry_run import DryRun
from bridge.drives.interface import DriveClient
from bridge.drives.wrapped import client_of
from bridge.frame import Frame
from configs.brief import AgentBrief
from configs.errors import InfrastructureError
from configs.events import Event, EventLog
from configs.ticks import Ticks


class Phase(Enum):
    """The phase of a controller; transitions are in `agents.agent`."""

    ARMING = auto()
    READY = auto()
    DRIVING = auto()
    STOPPED = auto()
    REARMING = auto()
    LEFT = auto()
    DONE = auto()


class TorqueOutcome(Enum):
    """The outcome of the law's torques in one tick."""

    UNCHANGED = auto()
    LIMITED = auto()  # adaptation would learn the limit
    WITHHELD = auto()
    RESTARTED = auto()  # withheld, and the law restarts with the next tick


UNCHANGED: Final = TorqueOutcome.UNCHANGED
_DRIVING: Final = Phase.DRIVING


class Guard:
    """Supervises one robot's drives. Pure: no I/O, no clock."""

    def __init__(self, brief: AgentBrief) -> None:
        host, schedule = brief.host, brief.schedule
        client = client_of(brief.drives, brief.robot)
        self.drives: DriveClient = DryRun(client) if host.dry_run else client
        self.phase = Phase.STOPPED if brief.rejoins else Phase.ARMING
        self.begun = brief.rejoins
        """Whether tick 0 has come."""
        self.outcome = TorqueOutcome.WITHHELD
        """The outcome of the law's torques in this tick."""
        self.stop_tick = 0
        self.stop_reason = ""
        """The reason for the present stop, "" while the robot is not stopped."""
        self._log = EventLog()
        self.events = self._log.kept
        """Events of the robot as its controller saw them; the first `MAX_EVENTS`."""
        self.announce: Callable[[Event], None] = lambda _: None
        """Callback for each event; set by the controller process."""
        self.stalled = ""
        """The reason for late ticks at present, "" if ticks are on time; set by the agent."""
        self.bus_fault: str | None = None
        """The fault of the bus, None if sends succeed; set by the agent."""
        self._brief = brief
        self._ticks = Ticks(schedule)
        self._when = schedule.when
        self._limiter = TorqueLimiter(
            host.torque_limit_wheel_N_m, host.torque_slew_limit_wheel_N_m_s, schedule.period_s
        )
        self._pose_age_ticks = -(-host.pose_age_limit_ns // schedule.period_ns)
        self._pose_until = self._pose_age_ticks if host.pose_age_limit_ns else schedule.ticks
        """The last tick that the newest fix is good for."""
        self._noted_faults: dict[str, str] = {}  # by source
        self._rearming = Rearming(host, at_least=int(brief.rejoins))
        self._refusal: str | None = None  # came while READY; only a person may clear it

    # --- notes from the agent ---------------------------------------------------------------

    def note_pose(self, tick: int) -> None:
        """Note a pose of this tick from the localisation system."""
        if self._pose_age_ticks:
            self._pose_until = tick + self._pose_age_ticks

    def note_fault(self, source: str, reason: str | None) -> None:
        """Note the fault of a source (a sensor, the path variable); None: no fault."""
        if reason is not None:
            self._noted_faults[source] = reason
        elif self._noted_faults:
            self._noted_faults.pop(source, None)

    def note(self, tick: int, kind: str, text: str = "") -> None:
        """Record and announce an event."""
        event = Event(tick, self._brief.robot, kind, text)
        if self._log.take(event):
            self.announce(event)

    def note_unsent(self, tick: int) -> None:
        """Note that the frames of this tick were not sent: arming has lost a step."""
        if not self.begun:
            self.phase = Phase.ARMING
            self.drives.disarm()
        elif self.phase is Phase.REARMING:
            self._stop(tick, "could not arm again: a frame of it was not sent")

    def note_joining(self, tick: int, s: float) -> None:
        """Note that the robot joins the formation at a tick, or again after a restart."""
        kind = "rejoined" if self._brief.rejoins else "joined"
        self.note(tick, kind, f"at s = {s:.4g} m")

    # --- before tick 0 ---------------------------------------------------------------------------

    def arm(self, tick: int) -> Sequence[Frame]:
        """The frames of a tick before tick 0: arming, or torque 0 once armed.

        Raises:
            InfrastructureError: the drives were not armed when control had to start.
        """
        drives, now_ns = self.drives, self._ticks.bus_time_ns(tick)
        if self.begun:  # of a controller that re-joins, until the drives are heard
            return drives.rest(now_ns)
        if tick >= 0:
            self.begin(tick)
        if self._refusal is not None:
            return drives.rest(now_ns)
        if not drives.armed:
            return drives.arm(now_ns)
        if drives.fault(now_ns) is None:
            if self.phase is not Phase.READY:
                self._change(tick, Phase.READY, "armed")
            return drives.torque(0.0, 0.0)
        self.phase = Phase.ARMING
        self._refusal = drives.refusal()
        return drives.disarm()

    def begin(self, tick: int) -> None:
        """Start control at tick 0.

        Raises:
            InfrastructureError: the drives were not armed when control had to start.
        """
        now_ns, drives = self._ticks.bus_time_ns(tick), self.drives
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
        """The frames of a tick for the law's torques; sets `outcome`.

        `trouble`: the reason for torques that are not finite, if it is known.
        """
        drives, now_ns = self.drives, self._ticks.bus_time_ns(tick)
        self.outcome = TorqueOutcome.WITHHELD
        if self.phase is not _DRIVING:
            return self._recover(tick, now_ns)
        fault = drives.fault(now_ns)
        if fault is not None:
            self.note(tick, "drive_error", fault)
        elif tick > self._pose_until or self._noted_faults or self.bus_fault:
            fault = self._own_fault(tick)
        if fault is None and not isfinite(right_wheel_N_m + left_wheel_N_m):
            fault = trouble or "the law asks for a torque that is not finite"
        if fault is not None:
            return self._stop(tick, fault)
        self.outcome = UNCHANGED
        if self._limiter.active:
            right, left = self._limiter(right_wheel_N_m, left_wheel_N_m)
            if right != right_wheel_N_m or left != left_wheel_N_m:
                self.outcome = TorqueOutcome.LIMITED
            return drives.torque(right, left)
        return drives.torque(right_wheel_N_m, left_wheel_N_m)

    def leave(self, tick: int) -> Sequence[Frame]:
        """The frames of a robot that has left the formation: torque 0 and idle for both wheels."""
        self.outcome = TorqueOutcome.WITHHELD
        if self.phase is Phase.LEFT:
            return self.drives.rest(self._ticks.bus_time_ns(tick))
        self._change(tick, Phase.LEFT, "left")
        return self.drives.disarm()

    def shut_down(self) -> Sequence[Frame]:
        """Disarm for good; latched at the drives if the scenario wants that."""
        self.phase = Phase.DONE
        frames = self.drives.disarm()
        if self._brief.host.on_exit == "estop":
            return [*frames, *self.drives.estop()]
        return frames

    def remarks(self) -> list[str]:
        """Remarks on the whole run for the report, in words."""
        dry = ["dry run: nothing was sent to the drives"] if self._brief.host.dry_run else []
        return [*dry, *self.drives.notices, *self._log.remarks()]

    def _own_fault(self, tick: int) -> str | None:
        """The first fault beside those of the drives, None if there is none."""
        if self.bus_fault:
            return self.bus_fault
        if tick > self._pose_until:
            age = tick - self._pose_until + self._pose_age_ticks
            age_s = age * self._brief.schedule.period_s
            return f"no pose from the localisation system for {age_s:.2f} s"
        return next(iter(self._noted_faults.values()), None)

    def _stop(self, tick: int, reason: str) -> Sequence[Frame]:
        """Stop: torque 0 and idle for both wheels."""
        if self.stalled:
            reason = f"{self.stalled}: {reason}"
        self.stop_tick = tick
        self.stop_reason = f"{self._when(tick)}: {reason}"
        self._change(tick, Phase.STOPPED, "stopped", reason)
        return self.drives.disarm()

    def _recover(self, tick: int, now_ns: int) -> Sequence[Frame]:
        """The frames of a stopped robot: wait for the end of obstacles, then arm, to torque 0."""
        drives, rearming = self.drives, self._rearming
        if self.phase is Phase.STOPPED:
            if rearming.exhausted or not rearming.may_begin(self._obstacle(tick, now_ns), now_ns):
                return drives.rest(now_ns)
            self._change(tick, Phase.REARMING, "rearming")
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
        self._change(tick, _DRIVING, "rearmed")
        return drives.torque(0.0, 0.0)

    def _obstacle(self, tick: int, now_ns: int) -> str | None:
        return self.drives.obstacle(now_ns) or self._own_fault(tick)

    def _change(self, tick: int, phase: Phase, kind: str, text: str = "") -> None:
        self.phase = phase
        self.note(tick, kind, text)
