"""The drives on buses that aren't ours: python-can's own interfaces, and one that breaks."""

import socket
import time
from collections.abc import Callable, Iterator

import can
import pytest

from bridge.can_bus import external, sockets
from bridge.can_bus.external import CombinedPort, ExternalBuses
from bridge.can_bus.hub import Hub
from bridge.frame import RTR, Frame
from configs.errors import InfrastructureError

VIRTUAL = (("channel", "attached"), ("interface", "virtual"))
FRAMES = [Frame(0x001, bytes(8)), Frame(0x009, b"12345678")]


class BreakableBus(can.BusABC):
    """An interface as a driver has it: a descriptor, and failures when the link is down."""

    links: dict[str, "BreakableBus"] = {}  # noqa: RUF012
    opened = 0
    unplugged = False

    def __init__(self, channel: str, **kwargs) -> None:  # noqa: ARG002
        if BreakableBus.unplugged:
            raise OSError(19, "No such device")
        self.ours, self.theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.down = False
        self.sent: list[can.Message] = []
        BreakableBus.links[channel] = self
        BreakableBus.opened += 1
        super().__init__(channel=channel)

    def fileno(self) -> int:
        return self.ours.fileno()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        if self.down:
            raise can.CanOperationError("Failed to transmit: Network is down", 100)
        self.sent.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:  # noqa: ARG002
        self.ours.settimeout(0.0)
        try:
            data = self.ours.recv(64)
        except BlockingIOError:
            return None, True
        if not data or data == b"down":
            raise can.CanOperationError("Error receiving: Network is down", 100)
        return can.Message(arbitration_id=data[0], data=data[1:], is_extended_id=False), True

    def shutdown(self) -> None:
        super().shutdown()
        self.ours.close()
        self.theirs.close()


@pytest.fixture
def breakable(monkeypatch) -> Iterator[Callable[[], BreakableBus]]:
    """The interface `breakable` on channel x; calling the fixture gives the bus open now."""
    monkeypatch.setattr(can.util, "VALID_INTERFACES", can.util.VALID_INTERFACES | {"breakable"})
    monkeypatch.setattr(can.interface, "_get_class_for_interface", lambda _: BreakableBus)
    monkeypatch.setattr(external, "REOPEN_S", 0.05)
    monkeypatch.setattr(BreakableBus, "opened", 0)
    monkeypatch.setattr(BreakableBus, "unplugged", False)
    yield lambda: BreakableBus.links["x"]


@pytest.fixture
def broken(breakable) -> Iterator[ExternalBuses]:
    end = ExternalBuses({"r1": (("channel", "x"), ("interface", "breakable"))})
    yield end
    end.close("")


def serve_until(end: ExternalBuses, holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 5.0
    while not holds():
        assert time.monotonic() < deadline
        end.serve(0.01)


def test_frames_of_drives_and_of_others_cross_an_interface_without_descriptor() -> None:
    end = ExternalBuses({"r1": VIRTUAL})
    try:
        with can.Bus(interface="virtual", channel="attached") as other:
            end.deliver("r1", 5, FRAMES)
            assert [other.recv(1.0).arbitration_id for _ in FRAMES] == [0x001, 0x009]
            other.send(can.Message(arbitration_id=0x0E, data=b"abcd", is_extended_id=False))
            other.send(
                can.Message(arbitration_id=0x17, is_remote_frame=True, dlc=8, is_extended_id=False)
            )
            heard: list[Frame] = []
            serve_until(end, lambda: heard.extend(end.receive("r1")) or len(heard) == 2)
            assert heard == [Frame(0x0E, b"abcd"), Frame(0x17 | RTR, bytes(8))]
            assert end.pending() == []
        assert end.troubles() == {}
    finally:
        end.close("over")
        end.close("over")


def test_error_frames_and_fd_frames_are_counted_and_not_heard() -> None:
    end = ExternalBuses({"r1": VIRTUAL})
    try:
        with can.Bus(interface="virtual", channel="attached") as other:
            other.send(can.Message(arbitration_id=0x20, is_error_frame=True, dlc=8, data=bytes(8)))
            other.send(can.Message(arbitration_id=0x0E, is_fd=True, data=bytes(12)))
            other.send(can.Message(arbitration_id=0x01, is_extended_id=False))
            serve_until(end, lambda: bool(end.pending()))
        assert end.troubles() == {"r1": "1 error frames; 1 × no frame of classic CAN"}
        assert end.receive("r1") == [Frame(0x01, b"")]
    finally:
        end.close("")


def test_an_interface_that_can_not_be_opened_is_named() -> None:
    with pytest.raises(
        InfrastructureError, match=r"drives of r1: no CAN bus: nonsense channel 'x'"
    ):
        ExternalBuses({"r1": (("channel", "x"), ("interface", "nonsense"))})


def test_a_link_that_goes_down_and_up_is_one_outage_and_works_again(broken, breakable) -> None:
    bus = breakable()
    bus.down = True
    bus.theirs.send(b"down")
    broken.serve(0.0)
    broken.deliver("r1", 0, FRAMES)
    broken.deliver("r1", 0, FRAMES)
    bus.down = False
    broken.deliver("r1", 0, FRAMES)
    assert [message.arbitration_id for message in bus.sent] == [0x001, 0x009]
    bus.theirs.send(b"\x0eabcd")
    broken.serve(1.0)
    assert broken.receive("r1") == [Frame(0x0E, b"abcd")]
    assert BreakableBus.opened == 1
    assert "1 × failed for 0.0 s in all, 4 frames lost; last: " in broken.troubles()["r1"]
    assert "Network is down" in broken.troubles()["r1"]


def test_an_adapter_that_was_unplugged_is_opened_again_once_it_is_back(broken, breakable) -> None:
    BreakableBus.unplugged = True
    breakable().theirs.close()  # its descriptor now says end of file for ever
    serve_until(broken, lambda: "No such device" in broken.troubles().get("r1", ""))
    broken.deliver("r1", 0, FRAMES)
    assert broken.clients() == 0
    BreakableBus.unplugged = False
    serve_until(broken, lambda: broken.clients() == 1)
    broken.deliver("r1", 0, FRAMES)
    assert len(breakable().sent) == 2
    assert broken.troubles()["r1"].startswith("1 × failed")
    assert BreakableBus.opened == 2


def test_what_nobody_takes_is_kept_up_to_a_bound(broken, breakable, monkeypatch) -> None:
    monkeypatch.setattr(external, "BACKLOG", 3)
    for n in range(5):
        breakable().theirs.send(bytes((n,)))
    serve_until(broken, lambda: broken.troubles() == {"r1": "2 frames lost"})
    assert len(broken.receive("r1")) == 3


def test_both_ends_are_one_for_the_plant(breakable) -> None:
    folder = sockets.create_run_folder("joined")
    hub = Hub(sockets.listen(folder, ["r2"]))
    others = ExternalBuses({"r1": (("channel", "x"), ("interface", "breakable"))})
    end = CombinedPort(hub, others, ["r1"])
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as waiting:
            waiting.connect(str(sockets.socket_path(folder, "r2")))
            end.serve(0.0)
        breakable().theirs.send(b"\x0eabcd")
        end.serve(1.0)
        assert end.pending() == ["r1"]
        assert end.receive("r1") == [Frame(0x0E, b"abcd")]
        end.deliver("r1", 0, FRAMES)
        end.deliver("r2", 0, FRAMES[:1])
        assert [message.arbitration_id for message in breakable().sent] == [0x001, 0x009]
        assert end.clients() == 1
    finally:
        end.close("over")
        sockets.remove_run_folder(folder)


def test_what_the_interface_hands_back_of_the_drives_own_frames_is_not_heard() -> None:
    settings = (*VIRTUAL, ("receive_own_messages", True))
    end = ExternalBuses({"r1": settings})
    try:
        with can.Bus(interface="virtual", channel="attached") as host:
            end.deliver("r1", 0, FRAMES)
            host.send(can.Message(arbitration_id=0x00E, data=bytes(4), is_extended_id=False))
            end.serve(0.5)
        assert end.receive("r1") == [Frame(0x00E, bytes(4))]
    finally:
        end.close("")
