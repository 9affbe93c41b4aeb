"""How far a sender may run ahead of who takes its packets, where the line itself sets no bound.

    sender      may send while  sent < given                   given starts at `WINDOW_BYTES`
    receiver    gives back what was taken, a quarter of the window at a time:
                given = `WINDOW_BYTES` + taken

    room        kind u8 = `ROOM`, 7 bytes padding, taken u64   little endian, 16 bytes

A packet counts as its length, at least `LEAST_BYTES`: as in a socket, a small one costs room too.
The last packet may go past the window, so that one as large as it gets always fits. Room packets
are outside the count. `taken` is a total, so one that is lost or late is made good by the next.
"""

import struct

from bridge.can_bus.packet import MAX_BYTES

WINDOW_BYTES = 128 * 1024
LEAST_BYTES = 256
ROOM = 0x40
_ROOM = struct.Struct("<B7xQ")


def cost(packet: bytes) -> int:
    """What a packet takes of a window [bytes]."""
    return max(len(packet), LEAST_BYTES)


class Sender:
    """The end that must not run ahead."""

    __slots__ = ("_given", "_sent")

    def __init__(self) -> None:
        self._sent = 0
        self._given = WINDOW_BYTES

    def has_room(self) -> bool:
        """Whether one more packet may go."""
        return self._sent < self._given

    def send(self, packet: bytes) -> None:
        """Count a packet that goes."""
        self._sent += cost(packet)

    def hear(self, packet: bytes) -> bool:
        """Take a room packet; False if it is something else."""
        if len(packet) != _ROOM.size or packet[0] != ROOM:
            return False
        _, taken = _ROOM.unpack(packet)
        # Nobody gives back what was never sent.
        self._given = max(self._given, WINDOW_BYTES + min(taken, self._sent))
        return True


class Receiver:
    """The end that takes."""

    __slots__ = ("_arrived", "_taken", "_told")

    def __init__(self) -> None:
        self._arrived = self._taken = self._told = 0

    def arrive(self, packet: bytes) -> bool:
        """Count a packet that came; False if its sender ran ahead of what it was given."""
        self._arrived += cost(packet)
        return self._arrived - self._told <= WINDOW_BYTES + MAX_BYTES

    def take(self, packet: bytes) -> bytes | None:
        """Count a packet that is out of the way; the room packet to send if one is due."""
        self._taken += cost(packet)
        if self._taken - self._told < WINDOW_BYTES // 4:
            return None
        self._told = self._taken
        return _ROOM.pack(ROOM, self._taken)
