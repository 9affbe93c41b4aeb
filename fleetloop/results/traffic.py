"""Traffic of a run's buses, of its BLF files: load, worst response times, drives' measurements.

Load counts the bits of a sample of each identifier's frames, exactly. Response times are those of
`bridge.wire.response_time` for what was sent periodically, its period the mean of the usual gaps.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bridge.drives import protocol
from bridge.drives.interface import MessageFormat
from bridge.frame import EFF, ID_MASK_29, RTR, Frame
from bridge.wire.bits import frame_bits
from bridge.wire.response_time import Analysis, Message, analyse
from configs.errors import ScenarioError
from configs.resolve import schedule
from configs.scenario import Scenario
from fleetloop.record.blf import REMOTE, TRANSMITTED, Array
from fleetloop.record.blf_reader import read_frames
from fleetloop.record.run_record import CAN_FOLDER

MOST_BUSES = 12
_WINDOWS = 500
"""Over which the load of a bus is the mean."""
_SAMPLE = 200
_PERIODIC, _JITTER = 20, 0.5
"""A message is periodic if it was sent so often, and most gaps differ by less than this part."""
_UNITS = ("A", "V", "°C")
Formats = Callable[[int], Sequence[MessageFormat]]
"""Of a drive protocol: the messages of a node."""


class Measured(NamedTuple):
    """What one drive said of itself over time."""

    node: int
    name: str
    unit: str
    t_s: np.ndarray
    values: np.ndarray


@dataclass(frozen=True, slots=True)
class Traffic:
    """Of one bus."""

    bus: str
    t_s: np.ndarray
    load: np.ndarray
    """Part of the bus's time, over windows that end at `t_s`."""
    analysis: Analysis | None
    """None: nothing was periodic."""
    measured: tuple[Measured, ...]

    @property
    def slowest(self) -> str:
        """The message whose worst case is the largest part of its period, in words."""
        if self.analysis is None:
            return "nothing periodic"
        one = self.analysis.slowest
        period = f"of its {one.period_ns * 1e-6:.3g} ms"
        name = f"0x{one.can_id & ID_MASK_29:03X}"
        if one.response_ns is None:
            return f"{name} without a bound {period}"
        return f"{name} {one.response_ns * 1e-6:.3g} ms {period}"


def traffic_of(run: Path, scenario: Scenario) -> list[Traffic]:
    """Of every bus whose BLF file the run left; of many the first ones."""
    try:
        formats = protocol(scenario.drive_choice.plugin).formats
    except ScenarioError:  # a run is shown where the files of its protocol aren't, too
        formats = None
    found = []
    for bus in scenario.buses[:MOST_BUSES]:
        try:
            frames = read_frames(run / CAN_FOLDER / f"{bus}.blf")
        except (OSError, ValueError):
            continue  # not recorded, or another tool's
        if len(frames):
            nodes = [
                node
                for robot in scenario.names
                if scenario.bus_of(robot) == bus
                for node in scenario.nodes_of(robot)
            ]
            found.append(_traffic(bus, frames, scenario, formats, nodes))
    return found


def _traffic(
    bus: str, frames: Array, scenario: Scenario, formats: Formats | None, nodes: Sequence[int]
) -> Traffic:
    start_ns, bitrate_bit_s = _start_ns(scenario), scenario.bus.bitrate_bit_s
    stamps_s = _seconds(frames, start_ns)
    bits = np.zeros(len(frames))
    messages = []
    by_identifier = _by_identifier(frames)
    for can_id, index in by_identifier.items():
        own = frames[index]
        bits[index] = mean_bits = _mean_bits(can_id, own)
        if (message := _periodic(can_id, own, mean_bits)) is not None:
            messages.append(message)
    edges = np.linspace(stamps_s[0], max(stamps_s[-1], stamps_s[0] + 1e-3), _WINDOWS + 1)
    sums, _ = np.histogram(stamps_s, edges, weights=bits)
    load = sums / (bitrate_bit_s * (edges[1] - edges[0]))
    measured = [
        one
        for node in nodes
        for form in (formats(node) if formats is not None else ())
        if form.can_id in by_identifier
        for one in _measured(node, form, frames[by_identifier[form.can_id]], start_ns)
    ]
    analysis = analyse(messages, bitrate_bit_s) if messages else None
    return Traffic(bus, edges[1:], load, analysis, tuple(measured))


def _start_ns(scenario: Scenario) -> int:
    """Bus time of tick 0: it begins with the countdown."""
    clock = schedule(scenario)
    return clock.countdown_ticks * clock.period_ns


def _seconds(frames: Array, start_ns: int) -> np.ndarray:
    """Scenario time of frames."""
    times: np.ndarray = (frames["time"].astype(float) - start_ns) * 1e-9
    return times


def _by_identifier(frames: Array) -> dict[int, np.ndarray]:
    """Indices of the frames of each identifier, with SocketCAN's flags."""
    remote = (frames["flags"] & REMOTE != 0) * np.uint32(RTR)
    ids = frames["id"] & np.uint32(EFF | ID_MASK_29) | remote
    order = np.argsort(ids, kind="stable")
    values, starts = np.unique(ids[order], return_index=True)
    parts = np.split(order, starts[1:])
    return {int(value): part for value, part in zip(values, parts, strict=True)}


def _mean_bits(can_id: int, own: Array) -> float:
    sample = own[:: max(1, len(own) // _SAMPLE)]
    frames = (Frame(can_id, row["data"][: row["length"]].tobytes()) for row in sample)
    return float(np.mean([frame_bits(frame) for frame in frames]))


def _periodic(can_id: int, own: Array, mean_bits: float) -> Message | None:
    if len(own) < _PERIODIC:
        return None
    gaps = np.diff(own["time"].astype(float))
    usual = float(np.median(gaps))
    near = np.abs(gaps - usual) < _JITTER * usual
    if usual <= 0.0 or np.mean(near) < _JITTER:
        return None
    return Message(can_id, int(own["length"].max()), round(gaps[near].mean()), mean_bits)


def _measured(node: int, form: MessageFormat, own: Array, start_ns: int) -> Iterator[Measured]:
    """What the frames of a message that a drive sent say in amperes, volts and degrees."""
    own = own[(own["flags"] & (TRANSMITTED | REMOTE) == 0) & (own["length"] >= form.length)]
    for signal in form.signals:
        first, odd = divmod(signal.first_bit, 8)
        if signal.unit in _UNITS and signal.is_float and not odd and len(own) > 1:
            data = np.ascontiguousarray(own["data"][:, first : first + 4])
            values = data.view("<f4").ravel().astype(float) * signal.scale
            yield Measured(node, signal.name, signal.unit, _seconds(own, start_ns), values)
