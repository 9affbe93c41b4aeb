"""A bus on which frames take no time.

lockstep    the drives' frames of an instant are the question, the answer reaches the drives at
            the same instant; replies go out at once and are a question again, until
            `MOST_A_TICK` frames came from clients: the rest waits for the next tick, so that a
            client that never stops asking can't stop time
real time   a set-point for both wheels is answered at once by their encoder frames; what is
            cyclic goes out with the ticks, or in its own time where encoder frames are more
            frequent. An external bus (another python-can interface) is one of these as well

Faults of frames and nodes act at the drives' end (`plant.bus.interference`).
"""

from collections.abc import Sequence
from typing import Final

from bridge.frame import Frame
from bridge.network.telemetry import FROM_DRIVE, FrameBuffer
from configs.brief import Schedule
from configs.ticks import Ticks
from plant.bus.interference import Interference
from plant.bus.port import ALL, Begin, Port, Steps
from plant.faults import BusFaults
from plant.robot import EmulatedRobot

MOST_A_TICK: Final = 1024


class IdealBus:
    """The robots of one bus on which frames take no time."""

    def __init__(
        self,
        robots: Sequence[EmulatedRobot],
        schedule: Schedule,
        substeps: int,
        port: Port,
        begin: Begin,
        log: FrameBuffer | None,
        faults: BusFaults,
    ) -> None:
        self.robots = list(robots)
        self.faults = faults
        self._interference = Interference(robots)
        faults.disturbances.disturb = self._interference.disturb
        self.crossed = 0
        self.now_ns = 0
        self.busy_ns: int | None = None
        self._log = log
        self._port = port
        self._schedule = schedule
        self._substeps = substeps
        self._ticks = Ticks(schedule)
        self._zero_ns = self._ticks.bus_time_ns(0)
        self._step_ns = schedule.period_ns // substeps
        self._begin = begin
        self._drives = [drive for robot in robots for drive in robot.drives]
        self.acts_between_ticks = any(
            robot.brief.drive.encoder_period_ns < schedule.period_ns for robot in robots
        )

    def node_counts(self) -> dict[str, dict[str, int]]:
        """Nothing: without bit timing there is no wire."""
        return {}

    # --- lockstep --------------------------------------------------------------------------------

    def steps(self) -> Steps:
        """The ticks from the first of the countdown to the closing one."""
        schedule, begin, substeps = self._schedule, self._begin, self._substeps
        port, ticks = self._port, self._ticks
        period_s, period_ns, last = schedule.period_s, schedule.period_ns, schedule.ticks
        robots, faults, interference = self.robots, self.faults, self._interference
        (single,) = robots if len(robots) == 1 else (None,)
        late: list[Frame] = []  # replies that wait for the next tick
        for tick in range(-schedule.countdown_ticks, last + 1):
            self.now_ns = bus_ns = ticks.bus_time_ns(tick)
            faults.begin(tick)
            begin(tick)
            if interference.acts:
                frames = interference.frames_due(bus_ns)
            elif single is not None:
                frames = single.frames_due(bus_ns)
            else:
                frames = sorted(frame for robot in robots for frame in robot.frames_due(bus_ns))
            self._record(bus_ns, frames, FROM_DRIVE)
            if late:
                frames, late = [*frames, *late], []
            port.deliver(bus_ns, frames)
            yield ALL
            answers = port.receive()
            if interference.acts:
                answers = interference.to_drives(answers, bus_ns)
            count = 0
            self.crossed += len(frames) + len(answers)
            while answers:
                count += len(answers)
                self._record(bus_ns, answers, 0)
                replies = self._react(answers, bus_ns)
                if not replies:
                    break
                self._record(bus_ns, replies, FROM_DRIVE)
                if count >= MOST_A_TICK:
                    late = replies
                    break
                port.deliver(bus_ns, replies)
                yield ALL
                answers = port.receive()
                if interference.acts:
                    answers = interference.to_drives(answers, bus_ns)
                self.crossed += len(replies) + len(answers)
            if 0 <= tick < last:
                t_s = tick * period_ns * 1e-9
                for robot in robots:
                    robot.advance(t_s, period_s, substeps)
            yield None

    # --- real time -------------------------------------------------------------------------------

    def next_ns(self) -> int:
        """The next bus time at which a drive has something to send."""
        return min(drive.next_due_ns for drive in self._drives)

    def react(self, now_ns: int) -> None:
        """Process the clients' frames, and answer."""
        self.move(now_ns)
        received = self._arriving(self._port.receive(), now_ns)
        self._record(now_ns, received, 0)
        replies = self._react(received, now_ns)
        for robot in self.robots:
            replies += self._leaving(robot.feedback(now_ns), now_ns)
        self.crossed += len(received)
        self._send(now_ns, replies)

    def advance(self, now_ns: int) -> None:
        """Let drives send what is due; bodies move when they are looked at."""
        if self.next_ns() <= now_ns:
            self.move(now_ns)
            self.send_due(now_ns)

    def move(self, bus_ns: int) -> None:
        """Move the bodies to a bus time."""
        self.now_ns = bus_ns
        for robot in self.robots:
            robot.move(bus_ns, self._zero_ns, self._step_ns)

    def send_due(self, bus_ns: int) -> None:
        """Let the drives send what is due at a tick."""
        if self._interference.acts:
            held = self._interference.to_drives((), bus_ns)
            self._record(bus_ns, held, 0)
            self.crossed += len(held)
            replies = self._react(held, bus_ns)
            replies += self._interference.frames_due(bus_ns)
            self._send(bus_ns, replies)
            return
        self._send(bus_ns, [frame for robot in self.robots for frame in robot.frames_due(bus_ns)])

    def _send(self, bus_ns: int, frames: list[Frame]) -> None:
        if frames:
            self.crossed += len(frames)
            self._record(bus_ns, frames, FROM_DRIVE)
            self._port.deliver(bus_ns, frames)

    def _record(self, end_ns: int, frames: list[Frame], flags: int) -> None:
        """Log what crossed the bus."""
        if self._log is not None:
            self._log.add(end_ns, frames, flags)

    def _arriving(self, sent: list[Frame], bus_ns: int) -> list[Frame]:
        """What arrives at the drives of frames of clients."""
        return self._interference.to_drives(sent, bus_ns) if self._interference.acts else sent

    def _leaving(self, sent: Sequence[Frame], bus_ns: int) -> Sequence[Frame]:
        """What arrives at the clients of frames of drives."""
        return self._interference.from_drives(sent, bus_ns) if self._interference.acts else sent

    def _react(self, frames: list[Frame], bus_ns: int) -> list[Frame]:
        if self._interference.acts:
            heard = self._interference.react(frames, bus_ns)
            return self._interference.from_drives(heard, bus_ns)
        replies: list[Frame] = []
        for robot in self.robots:
            for frame in frames:
                if replied := robot.on_frame(frame, bus_ns):
                    replies += replied
        return replies
