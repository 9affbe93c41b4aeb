"""Read a record into numpy arrays, complete or cut."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from configs.signals import Signal
from fleetloop.record import schema
from fleetloop.record.scan import RecordError, Scan, scan
from fleetloop.record.schema import Kind


@dataclass(frozen=True, slots=True)
class Record:
    """A run's record: per robot and source a structured array, one element per tick from tick 0 on.

    Fields are `tick` and the signals by name, of a controller its law's among them. Sources are as
    long as they were: a controller that ended early has fewer rows than the others.
    """

    path: Path
    robots: tuple[str, ...]
    plant: dict[str, np.ndarray]
    controller: dict[str, np.ndarray]
    signals: dict[str, tuple[Signal, ...]]
    """The table of each controller's rows: names, units and meanings."""
    scenario_toml: str
    lost: str
    """The missing part, and the cause; empty for a complete, undamaged record."""
    file: Scan | None = None
    """How it is in its file; of a record in memory None."""

    @classmethod
    def open(cls, path: Path, *, damaged: bool = False) -> "Record":
        """Read a record file; every byte of what is returned was checked.

        Args:
            path: the file.
            damaged: whether a damaged one may be read up to its first damage.

        Raises:
            RecordError: it is no record or damaged; the text says where and what.
        """
        blocks: dict[tuple[int, Kind], list[np.ndarray]] = {}

        def keep(channel: int, messages: np.ndarray) -> None:
            kind = schema.kind_of(channel)
            if kind is not Kind.POSE:
                number = schema.robot_number_of(channel)
                blocks.setdefault((number, kind), []).append(messages["payload"])

        found = scan(path, keep)
        if found.damaged and not damaged:
            raise RecordError(f"{path}: {found.lost}; --partial reads the part before it")
        layout = found.head.layout

        def rows(kind: Kind) -> dict[str, np.ndarray]:
            made = {}
            for number, robot in enumerate(layout.robots):
                empty = np.empty(0, layout.row_type(schema.channel_id(number, kind)))
                made[robot] = np.concatenate([empty, *blocks.get((number, kind), [])])
            return made

        plant, controller = rows(Kind.PLANT), rows(Kind.CONTROLLER)
        toml = found.head.scenario_toml
        signals = dict(zip(layout.robots, layout.controllers, strict=True))
        return cls(path, layout.robots, plant, controller, signals, toml, found.lost, found)

    def shortage(self) -> str:
        """The missing part and the extent of the rest; empty for a complete record."""
        return f"{self.lost}; in it are {self.extent()}" if self.lost else ""

    def extent(self) -> str:
        """How much is there: ticks of every robot, and up to what time; alike robots together."""
        alike: dict[str, list[str]] = {}
        for robot in self.robots:
            plant, controller = self.plant[robot], self.controller[robot]
            longer = max(plant, controller, key=len)
            text = f"{len(longer)} ticks"
            if len(longer):
                text += f" up to {longer['t_s'][-1]:g} s"
            if len(plant) != len(controller):
                shorter = "controller" if len(controller) < len(plant) else "plant"
                text += f" ({shorter} {min(len(plant), len(controller))})"
            alike.setdefault(text, []).append(robot)
        return "; ".join(f"{', '.join(robots)}: {text}" for text, robots in alike.items())
