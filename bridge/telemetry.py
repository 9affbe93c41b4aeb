"""What is recorded of every robot at every tick: two tables of signals and their packing.

A row is a fixed number of float64; rows of consecutive ticks make a block, the unit that travels
over Zenoh. The plant tells the truth about the robot; the controller tells what it used and
commanded. Both tables are the only place that knows the order of the signals: record, export,
figures and diff go by name.
"""

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

from bridge.frame import Frame


class Signal(NamedTuple):
    """One recorded signal."""

    name: str
    unit: str
    meaning: str


PLANT_SIGNALS: tuple[Signal, ...] = (
    Signal("t_s", "s", "scenario time of the tick"),
    Signal("x_m", "m", "true position, world"),
    Signal("y_m", "m", "true position, world"),
    Signal("theta_rad", "rad", "true heading, not wrapped"),
    Signal("v_m_s", "m/s", "true forward speed"),
    Signal("omega_rad_s", "rad/s", "true turn rate"),
    Signal("input_right_N_m", "N·m", "torque that the right drive was last told, before limits"),
    Signal("input_left_N_m", "N·m", "torque that the left drive was last told, before limits"),
    Signal("demand_right_N_m", "N·m", "torque asked of the right motor at last, after limits"),
    Signal("demand_left_N_m", "N·m", "torque asked of the left motor at last, after limits"),
    Signal("motor_right_N_m", "N·m", "torque that the right wheel felt at last"),
    Signal("motor_left_N_m", "N·m", "torque that the left wheel felt at last"),
)
"""Truth of one robot at one tick, before the controller answers."""

LAW_SIGNALS: tuple[Signal, ...] = (
    Signal("x_e_m", "m", "path following error, (8)"),
    Signal("y_e_m", "m", "path following error, (8)"),
    Signal("theta_e_rad", "rad", "path following error, (8), in (−π, π]"),
    Signal("alpha_theta_rad", "rad", "filtered virtual control, (19)"),
    Signal("alpha_v_m_s", "m/s", "filtered virtual control, (20)"),
    Signal("alpha_omega_rad_s", "rad/s", "filtered virtual control, (27)"),
    Signal("xi_e1_m_s", "m/s", "speed error, (30)"),
    Signal("xi_e2_rad_s", "rad/s", "turn rate error, (30)"),
    Signal("theta_hat_1", "kg·m²", "estimate of c b"),
    Signal("theta_hat_2", "N·m·s", "estimate of d̄_11"),
    Signal("theta_hat_3", "N·m·s", "estimate of d̄_12"),
    Signal("theta_hat_4", "kg·m²", "estimate of m̄_1"),
    Signal("theta_hat_5", "kg·m²", "estimate of c / b"),
    Signal("theta_hat_6", "N·m·s", "estimate of d̄_21"),
    Signal("theta_hat_7", "N·m·s", "estimate of d̄_22"),
    Signal("theta_hat_8", "kg·m²", "estimate of m̄_2"),
    Signal("kappa_hat", "N·m", "estimate of the disturbance bound, (36)"),
)
"""What a law says of one tick."""

AGENT_SIGNALS: tuple[Signal, ...] = (
    Signal("t_s", "s", "scenario time of the tick"),
    Signal("x_hat_m", "m", "position that the controller used"),
    Signal("y_hat_m", "m", "position that the controller used"),
    Signal("theta_hat_rad", "rad", "heading that the controller used"),
    Signal("v_hat_m_s", "m/s", "forward speed that the controller used"),
    Signal("omega_hat_rad_s", "rad/s", "turn rate that the controller used"),
    Signal("s", "m", "path variable"),
    Signal("s_dot", "m/s", "its rate, mu + v_r_hat"),
    Signal("mu", "m/s", "coordination state of (40)"),
    Signal("v_r_hat", "m/s", "estimate of the reference speed, (38)"),
    Signal("neighbours", "1", "in-neighbours that counted in the sums"),
    Signal("x_d_m", "m", "reference position, (1)"),
    Signal("y_d_m", "m", "reference position, (1)"),
    Signal("theta_d_rad", "rad", "reference heading, (8)"),
    *LAW_SIGNALS,
    Signal("tau_right_N_m", "N·m", "torque commanded, as float32 on the bus"),
    Signal("tau_left_N_m", "N·m", "torque commanded, as float32 on the bus"),
    Signal("late_s", "s", "in real time, wall time from the tick's due time to its computation"),
    Signal("round_trip_s", "s", "in real time, from the last torques sent to their feedback"),
)
"""One controller at one tick: what it used and what it commanded."""

PLANT_ROW = struct.Struct(f"<{len(PLANT_SIGNALS)}d")
AGENT_ROW = struct.Struct(f"<{len(AGENT_SIGNALS)}d")

BLOCK_TICKS = 128
"""Rows that are gathered before a block is sent."""


class RowBuffer:
    """Gathers the rows of consecutive ticks and hands them on as blocks.

    `hand_on(first_tick, count, rows, final)` gets a block whenever `BLOCK_TICKS` rows are there,
    and a last, perhaps empty one from `finish`.
    """

    __slots__ = ("_block", "_count", "_first_tick", "_hand_on", "_pack_into", "_size")

    def __init__(
        self, row: struct.Struct, hand_on: Callable[[int, int, bytes, bool], None]
    ) -> None:
        self._hand_on = hand_on
        self._pack_into = row.pack_into
        self._size = row.size
        self._block = bytearray(BLOCK_TICKS * row.size)
        self._first_tick = 0
        self._count = 0

    def add(self, tick: int, row: Sequence[float]) -> None:
        """Add the row of one tick."""
        count = self._count
        if count == 0:
            self._first_tick = tick
        self._pack_into(self._block, count * self._size, *row)
        self._count = count = count + 1
        if count == BLOCK_TICKS:
            self._flush(final=False)

    def finish(self) -> None:
        """Hand on what is left and say that nothing follows."""
        self._flush(final=True)

    def _flush(self, *, final: bool) -> None:
        rows = bytes(memoryview(self._block)[: self._count * self._size])
        self._hand_on(self._first_tick, self._count, rows, final)
        self._first_tick += self._count
        self._count = 0


FRAME_ROW = struct.Struct("<qIBB2x8s")
"""A frame that crossed a bus: end in bus time [ns], SocketCAN's identifier, length, flags, data."""
_TWO_FRAMES = struct.Struct("<qIBB2x8sqIBB2x8s")
FROM_DRIVE = 1
"""Flag of a frame that a drive sent."""
BLOCK_FRAMES = 1024

Tap = Callable[[int, Sequence[Frame], int], None]
"""Told what crosses a bus: end in bus time [ns], frames, flags."""


def no_tap(end_ns: int, frames: Sequence[Frame], flags: int) -> None:
    """Nobody listens."""


class FrameBuffer:
    """Gathers the frames of one bus and hands them on as blocks: (first, count, frames, final)."""

    __slots__ = ("_block", "_count", "_first", "_hand_on", "_pack_two")

    def __init__(self, hand_on: Callable[[int, int, bytes, bool], None]) -> None:
        self._hand_on = hand_on
        self._pack_two = _TWO_FRAMES.pack_into
        self._block = bytearray(BLOCK_FRAMES * FRAME_ROW.size)
        self._first = 0
        self._count = 0

    def add(self, end_ns: int, frames: Sequence[Frame], flags: int) -> None:
        """Add frames that ended at one bus time."""
        count = self._count
        if len(frames) == 2 and count < BLOCK_FRAMES - 2:
            (id_1, data_1), (id_2, data_2) = frames
            n_1, n_2 = len(data_1), len(data_2)
            at = count * FRAME_ROW.size
            self._pack_two(
                self._block, at, end_ns, id_1, n_1, flags, data_1, end_ns, id_2, n_2, flags, data_2
            )
            self._count = count + 2
            return
        for can_id, data in frames:
            at = self._count * FRAME_ROW.size
            FRAME_ROW.pack_into(self._block, at, end_ns, can_id, len(data), flags, data)
            self._count += 1
            if self._count == BLOCK_FRAMES:
                self._flush(final=False)

    def finish(self) -> None:
        """Hand on what is left and say that nothing follows."""
        self._flush(final=True)

    def _flush(self, *, final: bool) -> None:
        frames = bytes(memoryview(self._block)[: self._count * FRAME_ROW.size])
        self._hand_on(self._first, self._count, frames, final)
        self._first += self._count
        self._count = 0
