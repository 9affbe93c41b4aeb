"""What a plant says of its buses and drives for people: rates and loads since it last said so."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from bridge.network.link import Publisher
from bridge.network.messages import Progress
from bridge.network.status import BusStatus, DriveStatus, PlantStatus
from bridge.process.clock import SYSTEM_CLOCK, Clock
from plant.bus.port import Bus
from plant.robot import EmulatedRobot

STATUS_SHARE = 0.9
"""Of the period of statuses: they go with progress messages, which come a little early or late."""


class _Reading(NamedTuple):
    """Of a bus, at a bus time."""

    now_ns: int
    frames: int
    busy_ns: int | None

    @classmethod
    def of(cls, bus: Bus) -> "_Reading":
        return cls(bus.now_ns, bus.crossed, bus.busy_ns)


class PlantMeter:
    """Reads buses and drives from one status to the next.

    Args:
        buses: by name.
        robots: with the drives.
        waits_for: the robots for whose controllers time stands still.
    """

    def __init__(
        self,
        buses: Mapping[str, Bus],
        robots: Sequence[EmulatedRobot],
        waits_for: Callable[[], Sequence[str]] = tuple,
    ) -> None:
        self._waits_for = waits_for
        self._buses = buses
        self._robots = robots
        self._before = {name: _Reading.of(bus) for name, bus in buses.items()}
        self._last = {name: BusStatus(name, bus.crossed, None, None) for name, bus in buses.items()}

    def status(self) -> PlantStatus:
        """Their state now; of a bus whose time stands still the rates are the last ones."""
        return PlantStatus(
            tuple(self._bus(name, bus) for name, bus in self._buses.items()),
            tuple(
                DriveStatus(robot.brief.robot, *(drive.state_in_words for drive in robot.drives))
                for robot in self._robots
            ),
            tuple(self._waits_for()),
        )

    def _bus(self, name: str, bus: Bus) -> BusStatus:
        before, now = self._before[name], _Reading.of(bus)
        passed_ns = now.now_ns - before.now_ns
        if passed_ns > 0:
            load = None
            if now.busy_ns is not None and before.busy_ns is not None:
                load = (now.busy_ns - before.busy_ns) / passed_ns
            rate = (now.frames - before.frames) / (passed_ns * 1e-9)
            self._before[name] = now
            self._last[name] = BusStatus(name, now.frames, rate, load)
        return self._last[name]


class Narrator:
    """Says how far the plant is, and every so often what is to be seen of it."""

    def __init__(self, progress: Publisher, every_s: float, *, clock: Clock = SYSTEM_CLOCK) -> None:
        self.meter: PlantMeter | None = None
        """None: there is nothing to be seen yet."""
        self._progress = progress
        self._every_s = STATUS_SHARE * every_s
        self._clock = clock
        self._next_s = 0.0

    def say(self, state: Progress) -> None:
        """Put a progress message, with a status if one is due."""
        if self.meter is not None and (now_s := self._clock.monotonic_s()) >= self._next_s:
            self._next_s = now_s + self._every_s
            state = state._replace(status=self.meter.status())
        self._progress.put(state.encode())
