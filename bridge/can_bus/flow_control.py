"""Credit-based flow control between a remote client and the relay.

    sender      may send while  sent < granted          granted starts at `INITIAL_CREDIT_BYTES`
    receiver    returns the credit of consumed packets, a quarter of the initial credit at a time:
                granted = `INITIAL_CREDIT_BYTES` + consumed

    CREDIT      kind u8 = 0x40, 7 bytes padding, consumed u64        little endian, 16 bytes

A packet costs its length, at least `LEAST_BYTES`: a small packet also occupies a buffer. The last
packet may exceed the credit, so that a packet of maximum length always fits. CREDIT packets cost
nothing. `consumed` is a total, so the next CREDIT packet replaces a lost or late one.
"""

import struct
from typing import Final

from bridge.can_bus.packet import MAX_BYTES

INITIAL_CREDIT_BYTES: Final = 128 * 1024
LEAST_BYTES: Final = 256
CREDIT: Final = 0x40
_CREDIT: Final = struct.Struct("<B7xQ")


def cost(packet: bytes) -> int:
    """Credit that a packet costs [bytes]."""
    return max(len(packet), LEAST_BYTES)


class Sender:
    """The sending end: spends credit."""

    __slots__ = ("_granted", "_sent")

    def __init__(self) -> None:
        self._sent = 0
        self._granted = INITIAL_CREDIT_BYTES

    def has_credit(self) -> bool:
        """Whether one more packet may be sent."""
        return self._sent < self._granted

    def spend(self, packet: bytes) -> None:
        """Count a packet that is sent."""
        self._sent += cost(packet)

    def grant(self, packet: bytes) -> bool:
        """Take the credit of a CREDIT packet; False if the packet is another one."""
        if len(packet) != _CREDIT.size or packet[0] != CREDIT:
            return False
        _, consumed = _CREDIT.unpack(packet)
        # No receiver consumes more than was sent.
        self._granted = max(self._granted, INITIAL_CREDIT_BYTES + min(consumed, self._sent))
        return True


class Receiver:
    """The receiving end: returns credit."""

    __slots__ = ("_arrived", "_consumed", "_returned")

    def __init__(self) -> None:
        self._arrived = self._consumed = self._returned = 0

    def arrive(self, packet: bytes) -> bool:
        """Count a packet that arrived; False if its sender exceeded the credit."""
        self._arrived += cost(packet)
        return self._arrived - self._returned <= INITIAL_CREDIT_BYTES + MAX_BYTES

    def consume(self, packet: bytes) -> bytes | None:
        """Count a packet that was consumed; return the CREDIT packet to send, if one is due."""
        self._consumed += cost(packet)
        if self._consumed - self._returned < INITIAL_CREDIT_BYTES // 4:
            return None
        self._returned = self._consumed
        return _CREDIT.pack(CREDIT, self._consumed)
