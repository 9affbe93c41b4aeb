"""One bus in real time: its robots' drives and bodies, moved to whatever the wall clock says.

IdealLive   frames take no time: who sends torques is answered at once, what is cyclic goes out
            with the ticks, or in its own time where encoder frames come more often than these; any
            bus that is carried by somebody else is one of these as well
WireLive    a bus of ours with bit timing: frames end when the wire says, drives answer cyclically
"""

from collections.abc import Mapping, Sequence

from bridge.can_bus.drive_port import DrivePort
from bridge.can_bus.hub import Hub
from bridge.frame import Frame
from bridge.telemetry import FROM_DRIVE, Tap, no_tap
from configs.brief import PlantBrief
from plant.bus.build import wire_bus
from plant.bus.timed import WireBus
from plant.robot import Unit


class IdealLive:
    """The robots of a bus on which frames take no time."""

    def __init__(
        self, name: str, units: Sequence[Unit], end: DrivePort, zero_ns: int, step_ns: int, tap: Tap
    ) -> None:
        self._tap = tap
        self.units = units
        self._name = name
        self._end = end
        self._zero_ns = zero_ns
        self._step_ns = step_ns
        self._drives = [drive for unit in units for drive in unit.drives]

    @property
    def crossed(self) -> int:
        """How many frames crossed the bus."""
        counters = self._end.counters(self._name)
        return counters.from_drives + counters.from_clients

    def next_ns(self) -> int:
        """When a drive has something to say."""
        return min(drive.next_due_ns for drive in self._drives)

    def hear(self, now_ns: int) -> None:
        """Take what others sent, and answer."""
        self._move(now_ns)
        said = self._end.receive(self._name)
        self._tap(now_ns, said, 0)
        replies: list[Frame] = []
        for unit in self.units:
            for frame in said:
                replies += unit.hear(frame, now_ns)
            replies += unit.feedback(now_ns)
        if replies:
            self._tap(now_ns, replies, FROM_DRIVE)
            self._end.deliver(self._name, now_ns, replies)

    def advance(self, now_ns: int) -> None:
        """Let drives say what is due; bodies move when somebody asks."""
        if self.next_ns() <= now_ns:
            self._move(now_ns)
            self.speak(now_ns)

    def tick(self, bus_ns: int) -> None:
        """Be where a tick is."""
        self._move(bus_ns)

    def speak(self, bus_ns: int) -> None:
        """Say what is due at a tick."""
        frames = [frame for unit in self.units for frame in unit.frames_due(bus_ns)]
        if frames:
            self._tap(bus_ns, frames, FROM_DRIVE)
            self._end.deliver(self._name, bus_ns, frames)

    def _move(self, to_ns: int) -> None:
        for unit in self.units:
            unit.move(to_ns, self._zero_ns, self._step_ns)


class WireLive:
    """The robots of a bus of ours with bit timing."""

    def __init__(self, name: str, bus: WireBus, hub: Hub) -> None:
        self.units = bus.units
        self._name = name
        self._bus = bus
        self._hub = hub

    @property
    def crossed(self) -> int:
        """How many frames crossed the bus."""
        return self._bus.crossed

    def next_ns(self) -> int:
        """When the next frame ends or drive acts."""
        return self._bus.next_ns()

    def hear(self, now_ns: int) -> None:
        """Take what clients want to send."""
        self.advance(now_ns)
        for key in self._hub.departed(self._name):
            self._bus.depart(key)
        self._bus.take(self._hub.submitted(self._name))

    def advance(self, now_ns: int) -> None:
        """Let everything happen through this instant."""
        ask = self._bus.advance(now_ns)
        for key, count in ask.freed:
            self._hub.return_credit(self._name, key, count)
        if ask.transmitted:
            self._hub.forward(self._name, ask.stamp_ns, ask.transmitted)

    def tick(self, bus_ns: int) -> None:
        """Be where a tick is."""
        self.advance(bus_ns)

    def speak(self, bus_ns: int) -> None:
        """Drives say what is due when it is due."""


Live = IdealLive | WireLive


def live_buses(
    brief: PlantBrief,
    units: Sequence[Unit],
    end: DrivePort,
    hub: Hub,
    taps: Mapping[str, Tap],
) -> dict[str, Live]:
    """All buses by name; those on `hub` have bit timing if the brief wants it."""
    by_bus: dict[str, list[Unit]] = {}
    for unit in units:
        by_bus.setdefault(unit.brief.bus, []).append(unit)
    ours = hub.names
    zero_ns = brief.schedule.bus_time_ns(0)
    step_ns = brief.schedule.period_ns // brief.substeps
    lives: dict[str, Live] = {}
    for name, group in by_bus.items():
        tap = taps.get(name, no_tap)
        if brief.wire is not None and name in ours:
            bus = wire_bus(brief, name, group, lambda _: None, tap)
            lives[name] = WireLive(name, bus, hub)
        else:
            lives[name] = IdealLive(name, group, end, zero_ns, step_ns, tap)
    return lives
