"""One guest's line inside the relay: packets between its keys and a Unix socket at the hub.

What the hub has no room for waits here, as much as the window lets a guest send. What the guest has
no room for waits at the hub.
"""

import select
import socket
from collections import deque

from bridge.can_bus import packet as wire
from bridge.can_bus.flow_control import Receiver, Sender
from bridge.network.link import Publisher

READ, WRITE = select.EPOLLIN, select.EPOLLOUT
_BYE = bytes((wire.BYE,))


class Guest:
    """A guest that has said hello. Nothing here waits."""

    __slots__ = ("awaits", "down", "leaving", "place", "room", "sock", "taken", "told", "waiting")

    def __init__(self, place: str, sock: socket.socket, down: Publisher) -> None:
        self.place = place
        self.sock = sock
        self.down = down
        self.room = Sender()  # of the way down
        self.taken = Receiver()  # of the way up
        self.waiting: deque[bytes] = deque()  # the hub has no room for these yet
        self.leaving = self.told = False  # it said goodbye; it was told of the end
        self.awaits = READ

    def push(self) -> bool:
        """Give the hub what waits; whether nothing is left."""
        while self.waiting:
            try:
                self.sock.send(self.waiting[0])
            except BlockingIOError:
                return False
            except OSError:
                self.waiting.clear()  # the hub has gone; its last words are still to be read
                return True
            if (room := self.taken.take(self.waiting.popleft())) is not None:
                self.down.put(room)
        return True

    def pull(self, most: int | None) -> bool:
        """Hand on at most so many packets of the hub, as far as there is room; False at the end.

        None: all that is there, room or not: the hub's last words are as many as a socket holds.
        """
        while most is None or (most > 0 and self.room.has_room()):
            try:
                packet = self.sock.recv(wire.MAX_BYTES)
            except BlockingIOError:
                return True
            except ConnectionResetError:
                continue  # the hub left something unread; what it said is still there
            except OSError:
                return False
            if not packet:
                return False
            self.told |= packet[:1] == _BYE
            self.room.send(packet)
            self.down.put(packet)
            most = most and most - 1
        return True

    def wants(self) -> int:
        """What to wait for at the hub's socket."""
        read = READ if self.room.has_room() and not self.leaving else 0
        return read | (WRITE if self.waiting else 0)
