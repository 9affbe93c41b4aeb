"""The state of a robot as its controller says it, and of buses and drives as the plant says it.

Part of a `bridge.network.messages.Progress`: a few values for people, several times a second of
wall time, nothing that a run depends on. As fields of a message:

    ControllerStatus   ["controller", phase, x_e_m, y_e_m, theta_e_rad, right_wheel_N_m,
                        left_wheel_N_m, [[neighbour, age_s], ...]]
    PlantStatus        ["plant", [[bus, frames, frames_per_s, load], ...],
                        [[robot, right_state, left_state], ...], [robot, ...]]

nil is a value that isn't known. Decoding is bounded like that of messages.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

from bridge.network.packing import printable

MAX_WORDS = 48
"""Characters of a phase or a drive's state."""
MAX_NAME = 64
MAX_PARTS = 1024
"""Neighbours, buses or robots in one status."""

Value = float | None


class Heard(NamedTuple):
    """An in-neighbour whose edge exists."""

    neighbour: str
    age_s: Value  # of its newest path state; None: none was heard


class ControllerStatus(NamedTuple):
    """The state of one robot at a tick; None: not known."""

    phase: str  # of `agents.guard.Phase`, in lower case
    x_e_m: Value  # path following errors (8)
    y_e_m: Value
    theta_e_rad: Value
    right_wheel_N_m: Value  # torques last commanded
    left_wheel_N_m: Value
    heard: tuple[Heard, ...]

    def fields(self) -> list[Any]:
        """For the message."""
        return ["controller", self.phase[:MAX_WORDS], *map(known, self[1:6]), list(self.heard)]

    @classmethod
    def of(cls, fields: list[Any]) -> "ControllerStatus | None":
        """The status in fields of a message, None if there is none."""
        if len(fields) != 8 or not (_words(fields[1:2]) and _values(fields[2:7])):
            return None
        if not _table(fields[7], 2) or not all(
            _names(row[:1]) and _values(row[1:]) for row in fields[7]
        ):
            return None
        heard = tuple(Heard(printable(name), age_s) for name, age_s in fields[7])
        _, phase, x_e, y_e, theta_e, right, left, _ = fields
        return cls(printable(phase), x_e, y_e, theta_e, right, left, heard)


class BusStatus(NamedTuple):
    """One bus since its last status."""

    bus: str
    frames: int  # that crossed it since power-up
    frames_per_s: Value  # of bus time
    load: Value  # share of the time in which the wire was occupied; None: no bit timing


class DriveStatus(NamedTuple):
    """The states of both drives of a robot, in the words of their protocol."""

    robot: str
    right: str
    left: str


class PlantStatus(NamedTuple):
    """The state of the emulated buses and drives."""

    buses: tuple[BusStatus, ...]
    drives: tuple[DriveStatus, ...]
    waits_for: tuple[str, ...] = ()  # robots for whose controllers lockstep has waited for a while

    def fields(self) -> list[Any]:
        """For the message."""
        drives = [[robot, *(it[:MAX_WORDS] for it in states)] for robot, *states in self.drives]
        return ["plant", list(self.buses), drives, list(self.waits_for)]

    @classmethod
    def of(cls, fields: list[Any]) -> "PlantStatus | None":
        """The status in fields of a message, None if there is none."""
        if len(fields) != 4 or not (_table(fields[1], 4) and _table(fields[2], 3)):
            return None
        if not isinstance(fields[3], list) or len(fields[3]) > MAX_PARTS or not _names(fields[3]):
            return None
        if not all(
            _names(row[:1]) and _count(row[1]) and _values(row[2:], least=0.0) for row in fields[1]
        ):
            return None
        if not all(_names(row[:1]) and _words(row[1:]) for row in fields[2]):
            return None
        return cls(
            tuple(BusStatus(printable(bus), *rest) for bus, *rest in fields[1]),
            tuple(DriveStatus(*map(printable, row)) for row in fields[2]),
            tuple(map(printable, fields[3])),
        )


Status = ControllerStatus | PlantStatus


def status_of(fields: object) -> Status | None:
    """The status in fields of a message, None if there is none."""
    if not isinstance(fields, list) or not fields:
        return None
    match fields[0]:
        case "controller":
            return ControllerStatus.of(fields)
        case "plant":
            return PlantStatus.of(fields)
    return None


def known(value: Value) -> Value:
    """A value for a message: None unless it is finite."""
    return None if value is None or not isfinite(value) else value


def _values(values: Sequence[Any], least: float | None = None) -> bool:
    return all(
        value is None
        or (type(value) is float and isfinite(value) and (least is None or value >= least))
        for value in values
    )


def _count(value: object) -> bool:
    return type(value) is int and 0 <= value < 1 << 63


def _words(values: Sequence[Any]) -> bool:
    return all(type(value) is str and len(value) <= MAX_WORDS for value in values)


def _names(values: Sequence[Any]) -> bool:
    return all(type(value) is str and len(value) <= MAX_NAME for value in values)


def _table(rows: object, columns: int) -> bool:
    if not isinstance(rows, list) or len(rows) > MAX_PARTS:
        return False
    return all(isinstance(row, list) and len(row) == columns for row in rows)
