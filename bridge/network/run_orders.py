"""Orders to a run that goes on, beside those of faults: its pace, and the virtual leader's speed.

    PaceOrder     [1, number, what, value]                               @order/plant
    LeaderOrder   [1, number, from_tick, exact, speed_m_s, ramp_ns, reach]
                                          @order/<process>, of the plant and of each controller
    Standstill    [1, tick]                                              @order/agent/<robot>

They come on the same keys as orders of faults, and are answered like these. In lockstep the plant
owns time: it carries out what concerns the pace, and hands on the leader's speed to all controllers
ahead of a pose that each of them waits for. While it lets time stand still it says so, and no
controller takes that for the silence of a bus.
"""

from enum import StrEnum
from typing import NamedTuple

from bridge.network.packing import finite, ints, pack, unpack
from configs.leader_speed import SpeedChange
from configs.reach import Reach

_REACH = len(Reach._fields)


class Pace(StrEnum):
    """What a pace order asks for, and the meaning of its value."""

    PAUSE = "pause"  # no bus begins another tick; 0
    RESUME = "resume"  # 0
    STEP = "step"  # of a run that is paused; ticks
    SPEED = "speed"  # multiple of real time, 0: as fast as the machine allows


class PaceOrder(NamedTuple):
    """A change of a lockstep run's pace."""

    number: int  # of the order, for the answer
    what: Pace
    value: float = 0.0

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "PaceOrder | None":
        """The message in the bytes, None if there is none."""
        read = unpack(payload, 4)
        if read is None or not ints(read[1:2]) or not finite(read[3:]) or read[3] < 0.0:
            return None
        try:
            return cls(read[1], Pace(read[2]), read[3])
        except ValueError:
            return None


class LeaderOrder(NamedTuple):
    """A change of v_r from a tick on, at every controller: all have the wider reach with it."""

    number: int
    from_tick: int
    exact: bool
    """Refuse it if that tick has gone; otherwise it acts as soon as it can, not before."""
    speed_m_s: float
    ramp_ns: int
    reach: Reach  # of the scenario with this change

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "LeaderOrder | None":
        """The message in the bytes, None if there is none."""
        read = unpack(payload, 7)
        if read is None:
            return None
        _, number, from_tick, exact, speed_m_s, ramp_ns, reach = read
        if not ints([number, from_tick, ramp_ns]) or type(exact) is not bool or ramp_ns < 0:
            return None
        if type(reach) is not list or len(reach) != _REACH or not finite([speed_m_s, *reach]):
            return None
        return cls(number, from_tick, exact, speed_m_s, ramp_ns, Reach(*reach))

    def change(self, tick: int, period_ns: int) -> SpeedChange:
        """The change of v_r if it acts from a tick on."""
        return SpeedChange(tick * period_ns, self.speed_m_s, self.ramp_ns)


class Standstill(NamedTuple):
    """The plant lets time stand still for now, before this tick."""

    tick: int

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "Standstill | None":
        """The message in the bytes, None if there is none."""
        read = unpack(payload, 2)
        return cls(read[1]) if read is not None and ints(read[1:]) else None


def order_tick(from_tick: int, earliest: int, ticks: int, *, exact: bool) -> int | str:
    """The tick at which an order acts in a run of so many, or why it can't.

    Args:
        from_tick: as ordered.
        earliest: the first at which it can act.
        ticks: of the run.
        exact: whether it acts at `from_tick` or not at all.
    """
    if exact and from_tick < earliest:
        return f"tick {from_tick} has gone: tick {earliest} is the next that it can act at"
    tick = max(from_tick, earliest, 0)
    return tick if tick < ticks else f"the run ends before: it has {ticks} ticks"
