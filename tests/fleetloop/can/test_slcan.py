"""The slcan adapter: its protocol line by line, and python-can's slcan interface on its port."""

import os
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import can
import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from bridge.can_bus.pythoncan import to_message
from bridge.frame import EFF, ERR, RTR, Frame
from configs.errors import InfrastructureError
from fleetloop.can import slcan
from fleetloop.can.client import open_bus
from fleetloop.can.slcan import Port, offer
from fleetloop.can.slcan_adapter import Adapter, parse

frames = st.builds(
    Frame, st.integers(0, 0x7FF) | st.integers(EFF, EFF | 0x1FFF_FFFF), st.binary(max_size=8)
) | st.builds(
    lambda can_id, length: Frame(can_id | RTR, bytes(length)),
    st.integers(0, 0x7FF) | st.integers(EFF, EFF | 0x1FFF_FFFF),
    st.integers(0, 8),
)


@pytest.mark.parametrize(
    ("lines", "replies"),
    [
        (b"S6\rO\r", b"\r\r"),
        (b"S6\rs031C\rL\r", b"\r\r\r"),
        (b"O\rO\r", b"\r\a"),
        (b"O\rS6\r", b"\r\a"),
        (b"O\rC\rS8\r", b"\r\r\r"),
        (b"C\r", b"\r"),
        (b"\r\n\r", b"\r\r"),
        (b"V\rv\rN\r", b"V0101\rv0101\rNFL01\r"),
        (b"F\r", b"F00\r"),
        (b"Z1\rZ0\rZ2\r", b"\r\r\a"),
        (b"M00000000\rmFFFFFFFF\rW2\rU1\rQ0\rX1\r", b"\r" * 6),
        (b"X0\rP\rA\rS\rSa\rM0\rhello\r", b"\a" * 7),
        (b"t1230\r", b"\a"),
        (b"L\rt1230\r", b"\r\a"),
        (b"O\rt1232AABB\rT1ABCDEF00\rr1238\rR000000011\r", b"\rz\rZ\rz\rZ\r"),
        (b"O\rt1239\rt8000\rt123\rt1231A\rt1231A0B\rT200000000\rr1231AA\r", b"\r" + b"\a" * 7),
        (b"x" * 1000 + b"\rN\r", b"\aNFL01\r"),
    ],
)
def test_every_line_has_its_reply(lines: bytes, replies: bytes) -> None:
    assert Adapter().process(lines).reply == replies


def test_frames_of_lines_are_those_of_the_manual() -> None:
    adapter = Adapter()
    adapter.process(b"O\r")
    heard = adapter.process(b"t10021133\rT0000010021133\rr1000\rr100\rR00000100 8\rR000001008\r")
    assert heard.frames == (
        Frame(0x100, b"\x11\x33"),
        Frame(0x100 | EFF, b"\x11\x33"),
        Frame(0x100 | RTR, b""),
        Frame(0x100 | RTR, b""),
        Frame(0x100 | EFF | RTR, bytes(8)),
    )


@given(frames, st.integers(0, 10**12))
def test_what_is_shown_is_what_is_parsed(frame: Frame, stamp_ns: int) -> None:
    adapter = Adapter()
    adapter.process(b"O\r")
    line = adapter.show(frame, stamp_ns)
    assert parse(line.removesuffix(b"\r")) == frame
    adapter.process(b"Z1\r")
    assert adapter.show(frame, stamp_ns) == (
        line[:-1] + f"{stamp_ns // 10**6 % 60_000:04X}\r".encode()
    )


@given(st.lists(st.binary(max_size=40), max_size=5))
def test_no_bytes_can_raise_and_portions_do_not_matter(portions: list[bytes]) -> None:
    whole, parted = Adapter(), Adapter()
    replies = [parted.process(portion) for portion in portions]
    together = whole.process(b"".join(portions))
    assert b"".join(reply.reply for reply in replies) == together.reply
    assert sum((reply.frames for reply in replies), ()) == together.frames


def test_status_flags_tell_of_errors_and_dropped_frames_once() -> None:
    adapter = Adapter()
    adapter.process(b"O\r")
    assert adapter.show(Frame(ERR | 0x80, bytes(8)), 0) == b""
    assert adapter.process(b"F\rF\r").reply == b"F80\rF00\r"
    adapter.overrun()
    assert adapter.process(b"F\r").reply == b"F08\r"


def test_a_closed_adapter_shows_nothing() -> None:
    assert Adapter().show(Frame(1, b""), 0) == b""


class Served:
    """A port that a thread serves."""

    def __init__(self, port: Port) -> None:
        self.port = port
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._over.is_set():
            self.port.serve(0.02)

    def stop(self) -> None:
        self._over.set()
        self._thread.join()


@pytest.fixture
def served(buses) -> Iterator[Served]:
    with open_bus("r1") as bus, closing(Port(bus)) as port:
        served = Served(port)
        yield served
        served.stop()


def software(served: Served, **options) -> can.BusABC:
    options = {"bitrate": 1_000_000, "sleep_after_open": 0.0} | options
    return can.Bus(interface="slcan", channel=served.port.device, **options)


SENT = [
    Frame(0x123, b"\xde\xad"),
    Frame(0x1ABCDEF0 | EFF, bytes(range(8))),
    Frame(0x017 | RTR, bytes(8)),
    Frame(0x00000017 | EFF | RTR, b""),
    Frame(0x7FF, b""),
]


def test_python_can_s_slcan_sends_and_receives_every_kind_of_frame(buses, served) -> None:
    with software(served) as bus:
        for frame in SENT:
            bus.send(to_message(frame.can_id, frame.data))
        assert buses.taken(len(SENT)) == SENT
        buses.deliver(*SENT)
        for frame in SENT:
            heard = None
            while heard is None:  # its replies come between, as None
                heard = bus.recv(5.0)
            assert heard.equals(
                to_message(frame.can_id, frame.data),
                timestamp_delta=None,
                check_channel=False,
                check_direction=False,
            )
        assert bus.get_version(5.0) == (1, 1)
        assert bus.get_serial_number(5.0) == "FL01"


def test_listening_software_cannot_send(buses, served) -> None:
    with software(served, listen_only=True) as bus:
        bus.send(can.Message(arbitration_id=1, is_extended_id=False))
        bus.get_version(5.0)
    assert served.port.counters.sent == 0


def test_software_that_does_not_read_blocks_nothing_and_finds_the_overrun(
    buses, served, monkeypatch
) -> None:
    count = 6000
    with serial.Serial(served.port.device, timeout=5.0) as port:
        port.write(b"S8\rO\r")
        assert port.read(2) == b"\r\r"
        for k in range(count):
            buses.deliver(Frame(0x123, k.to_bytes(8, "big")), stamp_ns=k)
        counters = served.port.counters
        assert buses.until(lambda: counters.received + counters.dropped == count)
        assert counters.dropped > 0
        lines = [port.read_until(b"\r") for _ in range(counters.received)]
        assert lines == [f"t1238{k:016X}\r".encode() for k in range(counters.received)]
        port.write(b"F\r")
        assert port.read_until(b"\r") == b"F08\r"


def test_software_that_leaves_leaves_a_fresh_adapter(buses, served) -> None:
    with serial.Serial(served.port.device, timeout=5.0) as port:
        port.write(b"Z1\rO\r")
        assert port.read(2) == b"\r\r"
    assert buses.until(lambda: not served.port._adapter.opened)
    buses.deliver(Frame(1, b""))
    with serial.Serial(served.port.device, timeout=5.0) as port:
        port.write(b"O\r")
        assert port.read(1) == b"\r"
        buses.deliver(Frame(2, b""))
        assert port.read_until(b"\r") == b"t0020\r"


def test_the_link_names_the_device_and_goes_with_the_adapter(
    buses, in_background, tmp_path: Path, capsys
) -> None:
    link = tmp_path / "ttyCAN"
    link.symlink_to(tmp_path / "of a killed adapter")
    statuses: list[int] = []
    thread = in_background(lambda: statuses.append(offer("r1", link)))
    buses.await_clients(1)
    assert buses.until(lambda: os.path.exists(link))  # noqa: PTH110
    with can.Bus(interface="slcan", channel=str(link), sleep_after_open=0.0) as bus:
        bus.send(can.Message(arbitration_id=5, is_extended_id=False))
        assert buses.taken(1) == [Frame(5, b"")]
    buses.end()
    thread.join(10.0)
    told = capsys.readouterr()
    assert statuses == [0]
    assert told.out == f"{link}\n"
    assert "0 frames to the software, 1 from it, 0 dropped" in told.err
    assert not link.is_symlink()


def test_a_link_in_the_way_is_refused_and_stays(buses, tmp_path: Path) -> None:
    link = tmp_path / "ttyCAN"
    link.write_text("mine")
    with pytest.raises(InfrastructureError, match="can't make the link"):
        offer("r1", link)
    assert link.read_text() == "mine"


def test_an_interrupt_ends_it_with_130(buses, monkeypatch, capsys) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(slcan.Port, "serve", interrupted)
    assert offer("r1", None) == 130
