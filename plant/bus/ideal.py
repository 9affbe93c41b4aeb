"""One bus in lockstep, step by step: its robots' drives and bodies, and whom it waits for.

A bus is a generator over its ticks. At each it yields the questions that its controllers have to
answer (an `Ask`), is sent what the clients of the bus had to say, and yields None when the tick is
over. Who drives it, over sockets or by calls, changes nothing of what happens.

    IdealBus    frames take no time: the drives' frames of an instant are the question, the answer
                reaches them at the same instant; replies go out at once and are a question again,
                until `MOST_A_TICK` frames were heard: the rest waits for the next tick, so that
                nobody who never stops asking can stop time
"""

from collections.abc import Callable, Generator, Sequence
from typing import NamedTuple, TypeVar

from bridge.can_bus.packet import Key, Transmitted
from bridge.frame import Frame
from bridge.telemetry import FROM_DRIVE, Tap
from configs.brief import Schedule
from plant.robot import Unit


class Ask(NamedTuple):
    """What the clients of a bus hear, and who has to answer it."""

    stamp_ns: int
    frames: Sequence[Frame]  # on an ideal bus: all of this instant
    transmitted: Sequence[Transmitted] = ()  # on a bus with bit timing
    asked: str = ""  # a robot; "": all of the bus
    freed: Sequence[tuple[Key, int]] = ()  # frames that left the transmit queues of clients


_new = tuple.__new__  # of a question, past its constructor: this is the hot path
MOST_A_TICK = 1024
_Answer = TypeVar("_Answer")
Steps = Generator[Ask | None, Sequence[_Answer], None]
Begin = Callable[[int], None]
"""Told each tick as it begins, bodies being where they are at that instant."""


class IdealBus:
    """The robots of one bus on which frames take no time."""

    def __init__(
        self, units: Sequence[Unit], schedule: Schedule, substeps: int, begin: Begin, tap: Tap
    ) -> None:
        self.units = units
        self._tap = tap
        self._schedule = schedule
        self._substeps = substeps
        self._begin = begin

    def steps(self) -> Steps[Frame]:
        """The ticks from the first of the countdown to the closing one."""
        schedule, begin, substeps = self._schedule, self._begin, self._substeps
        tap = self._tap
        period_s, period_ns, last = schedule.period_s, schedule.period_ns, schedule.ticks
        units = self.units
        (unit,) = units if len(units) == 1 else (None,)
        late: list[Frame] = []  # replies that nobody was told in their own tick
        for tick in range(-schedule.countdown_ticks, last + 1):
            bus_ns = schedule.bus_time_ns(tick)
            begin(tick)
            if unit is not None:
                frames = unit.frames_due(bus_ns)
            else:
                frames = sorted(frame for u in units for frame in u.frames_due(bus_ns))
            tap(bus_ns, frames, FROM_DRIVE)
            if late:
                frames, late = [*frames, *late], []
            answers = yield _new(Ask, (bus_ns, frames, (), "", ()))
            heard = 0
            while answers:
                heard += len(answers)
                tap(bus_ns, answers, 0)
                replies = self._hear(answers, bus_ns)
                if not replies:
                    break
                tap(bus_ns, replies, FROM_DRIVE)
                if heard >= MOST_A_TICK:
                    late = replies
                    break
                answers = yield Ask(bus_ns, replies)
            if 0 <= tick < last:
                t_s = tick * period_ns * 1e-9
                for u in units:
                    u.advance(t_s, period_s, substeps)
            yield None

    def _hear(self, frames: Sequence[Frame], bus_ns: int) -> list[Frame]:
        replies: list[Frame] = []
        for unit in self.units:
            hear = unit.hear
            for frame in frames:
                if replied := hear(frame, bus_ns):
                    replies += replied
        return replies
