"""Fault confinement of one CAN node, by ISO 11898-1: two counters and what follows from them.

    event                                                                 counter
    a frame sent                                                          TEC − 1, not below 0
    a sent frame destroyed, or not acknowledged                           TEC + 8
    the same for want of an acknowledgement only, while error passive     TEC as it is
    a frame received                                                      REC − 1; 120 if above 127
    a frame seen destroyed                                                REC + 1
    as above, and the first to say so                                     REC + 8 more

    state           when                           what the node may do
    ERROR_ACTIVE    both below 96                  everything; its error flag destroys a bad frame
    ERROR_WARNING   one 96 or above                the same
    ERROR_PASSIVE   one above 127                  send, with a pause of 8 bits after each frame of
                                                   its own; its error flag destroys no frame
    BUS_OFF         TEC above 255                  nothing, until restarted and after 128 times 11
                                                   recessive bits

So 16 destroyed frames in a row make a sender passive and 32 take it off the bus; a lone node, whose
frames no other node acknowledges, ends passive. The standard lets REC stop counting above 127 and
return to any value from 119 to 127; 120 is the value of bxCAN (ST RM0008, CAN_ESR).
"""

from enum import IntEnum
from typing import Final

WARNING: Final = 96
PASSIVE: Final = 128
OFF: Final = 256
RECOVERY_SEQUENCES: Final = 128
RECESSIVE_BITS: Final = 11
_REC_AFTER_PASSIVE: Final = 120


class NodeState(IntEnum):
    """Fault confinement state; the worse the higher."""

    ERROR_ACTIVE = 0
    ERROR_WARNING = 1
    ERROR_PASSIVE = 2
    BUS_OFF = 3


ERROR_ACTIVE: Final = NodeState.ERROR_ACTIVE
ERROR_PASSIVE: Final = NodeState.ERROR_PASSIVE
BUS_OFF: Final = NodeState.BUS_OFF


class Confinement:
    """The error counters of one node; `tec` and `rec` are what its controller would show."""

    __slots__ = ("rec", "tec")

    def __init__(self) -> None:
        self.tec = 0
        self.rec = 0

    @property
    def state(self) -> NodeState:
        """The state that the counters stand for."""
        worst = max(self.tec, self.rec)
        if worst < WARNING:
            return NodeState.ERROR_ACTIVE
        if worst < PASSIVE:
            return NodeState.ERROR_WARNING
        return NodeState.ERROR_PASSIVE if self.tec < OFF else NodeState.BUS_OFF

    def sent(self) -> None:
        """A frame was sent and acknowledged."""
        if self.tec:
            self.tec -= 1

    def send_failed(self) -> None:
        """A frame of this node was destroyed."""
        self.tec += 8

    def not_acknowledged(self) -> None:
        """A frame of this node was intact, but no node acknowledged it."""
        if max(self.tec, self.rec) < PASSIVE:
            self.tec += 8

    def received(self) -> None:
        """A frame was received."""
        if self.rec >= PASSIVE:
            self.rec = _REC_AFTER_PASSIVE
        elif self.rec:
            self.rec -= 1

    def receive_failed(self, *, first: bool = False) -> None:
        """A frame of another node was destroyed; `first`: this node was the one to say so."""
        if self.rec < PASSIVE:
            self.rec += 9 if first else 1

    def restart(self) -> None:
        """Back on the bus."""
        self.tec = self.rec = 0
