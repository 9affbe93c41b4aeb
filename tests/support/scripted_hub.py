"""A real hub whose controllers are raw sockets of the test, in its thread and by its clock."""

import socket
from collections.abc import Callable, Sequence
from contextlib import suppress

from support.clocks import ManualClock

from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub
from bridge.can_bus.packet import (
    BYE,
    DONE,
    FRAMES,
    HELLO,
    MAX_BYTES,
    SYNCHRONOUS,
    VERSION,
    decode,
    encode_frames,
    encode_text,
)
from bridge.frame import Frame
from bridge.process.waiting import readable

RUN, SECRET = "scripted", "told to nobody else"


class Controller:
    """A robot's controller that answers every question, with nothing or with frames."""

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.answers = True
        self.said: Sequence[Frame] = ()
        self.stamps_ns: list[int] = []
        self.goodbye = ""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.connect(str(sockets.socket_path(sockets.base_folder() / RUN, robot)))
        hello = encode_text(HELLO, f"{robot}\0{SECRET}", flags=SYNCHRONOUS, count=VERSION)
        self._socket.send(hello)

    def answer(self) -> None:
        """Take what is there, and answer each question."""
        while self.answers and self._socket.fileno() >= 0:
            try:
                packet = decode(self._socket.recv(MAX_BYTES, socket.MSG_DONTWAIT))
            except BlockingIOError:
                return
            if packet is None:
                self.leave()
            elif packet.kind == BYE:
                self.goodbye = packet.text
            elif packet.kind == FRAMES:
                self.stamps_ns.append(packet.stamp_ns)
                with suppress(OSError):
                    self._socket.send(encode_frames(DONE, packet.stamp_ns, self.said))

    def leave(self) -> None:
        """End as a process does that is killed."""
        self._socket.close()


class ScriptedHub(Hub):
    """A hub with a bus for each robot; while it waits for nobody's answer the clock goes on."""

    def __init__(self, robots: Sequence[str], clock: ManualClock) -> None:
        listeners = sockets.listen(sockets.create_run_folder(RUN), robots)
        told = {robot: {robot: SECRET} for robot in robots}
        super().__init__(listeners, controllers=told, clock=clock)
        self._passes = clock.passes
        self.controllers = {robot: Controller(robot) for robot in robots}
        self.script: Callable[[], None] = lambda: None
        """Called before controllers answer."""
        for _ in range(4):
            super().serve(0.0)

    def collect(self, timeout_s: float) -> list[str]:
        self.script()
        for controller in self.controllers.values():
            controller.answer()
        while not (answered := super().collect(0.0)) and readable([self], 0.0):
            pass
        if not answered:
            self._passes(timeout_s)
        return answered

    def serve(self, timeout_s: float) -> None:
        self.script()
        super().serve(0.0)
        self._passes(timeout_s)

    def again(self, robot: str) -> None:
        """A new process is the controller of a robot."""
        self.controllers[robot] = Controller(robot)

    def end(self) -> None:
        self.close("the test is over")
        for controller in self.controllers.values():
            controller.leave()
        sockets.remove_run_folder(sockets.base_folder() / RUN)
