"""Clients of a bus made of raw sockets, and a hub that the test serves."""

import socket

from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub
from bridge.can_bus.packet import (
    FRAMES,
    HELLO,
    MAX_BYTES,
    MORE,
    VERSION,
    Packet,
    decode,
    encode_frames,
    encode_text,
)
from bridge.frame import Frame

SECRET = "told to nobody else"
CONTROLLERS = {"r1": {"r1": SECRET, "r2": "another"}}


class Stranger:
    """A client made of a socket."""

    def __init__(self, name: str = "", flags: int = 0, version: int = VERSION) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.connect(str(sockets.socket_path(sockets.base_folder() / "hub", "r1")))
        self.socket.settimeout(5.0)
        self.say(encode_text(HELLO, name, flags=flags, count=version))

    def say(self, data: bytes) -> None:
        self.socket.send(data)

    def frames(self, *frames: Frame, flags: int = 0, stamp_ns: int = 0) -> None:
        self.say(encode_frames(flags, stamp_ns, frames))

    def hear(self) -> Packet:
        packet = decode(self.socket.recv(MAX_BYTES))
        assert packet is not None
        return packet

    def hear_question(self) -> list[Frame]:
        """All frames of a question, in however many packets it comes."""
        frames: list[Frame] = []
        while True:
            packet = self.hear()
            assert packet.kind == FRAMES
            frames += packet.frames
            if not packet.flags & MORE:
                return frames


class Serving:
    """A hub that the test serves."""

    def __init__(self, queue: int = 0) -> None:
        folder = sockets.create_run_folder("hub")
        self.hub = Hub(sockets.listen(folder, ("r1",)), queue=queue, controllers=CONTROLLERS)
        self.strangers: list[Stranger] = []

    def join(self, name: str = "", flags: int = 0, version: int = VERSION) -> Stranger:
        stranger = Stranger(name, flags, version)
        self.strangers.append(stranger)
        self.serve()
        return stranger

    def serve(self) -> None:
        """Handle all that is there."""
        for _ in range(5):
            self.hub.serve(0.0)

    def close(self) -> None:
        self.hub.close("the test is over")
        for stranger in self.strangers:
            stranger.socket.close()
        sockets.remove_run_folder(sockets.base_folder() / "hub")
