"""`dump` on a bus in this process: lines, filters, and every way to end."""

import io
import os

import can
import pytest

from bridge.frame import EFF, ERR, RTR, Frame
from configs.errors import InfrastructureError, ScenarioError
from fleetloop.can import dump as dumping
from fleetloop.can.client import Heard
from fleetloop.can.dump import DumpOptions, Printer, Stamps, dump

ENCODER = Frame(0x009, bytes.fromhex("0000803F00000000"))


def lines(options: DumpOptions, *heard: Heard) -> list[str]:
    printer = Printer(options, ["r1"])
    return [printer.lines(item) for item in heard]


def test_console_lines_are_candump_s() -> None:
    assert lines(DumpOptions(), Heard("r1", ENCODER, 5)) == [
        "  r1  009   [8]  00 00 80 3F 00 00 00 00\n"
    ]
    assert lines(DumpOptions(stamps="a"), Heard("r1", ENCODER, 1_436_509_052_249_713_999)) == [
        " (1436509052.249713)  r1  009   [8]  00 00 80 3F 00 00 00 00\n"
    ]


def test_log_lines_are_candump_s() -> None:
    frame = Frame(0x044, bytes.fromhex("2A366C2BBA"))
    assert lines(DumpOptions(log_format=True), Heard("r1", frame, 1_436_509_052_249_713_000)) == [
        "(1436509052.249713) r1 044#2A366C2BBA\n"
    ]


def test_short_identifiers_move_right_once_a_long_one_was_seen() -> None:
    short, long = Heard("r1", Frame(1, b""), 0), Heard("r1", Frame(EFF | 1, b""), 0)
    assert lines(DumpOptions(), short, long, short) == [
        "  r1  001   [0] \n",
        "  r1  00000001   [0] \n",
        "  r1       001   [0] \n",
    ]


def test_words_and_error_classes_are_appended() -> None:
    (decoded,) = lines(DumpOptions(decode=True), Heard("r1", ENCODER, 0))
    assert decoded == (
        "  r1  009   [8]  00 00 80 3F 00 00 00 00   node  0  Get_Encoder_Estimates"
        "  Pos_Estimate=1 rev  Vel_Estimate=0 rev/s\n"
    )
    (explained,) = lines(
        DumpOptions(explain_errors=True), Heard("r1", Frame(ERR | 0x40, bytes(8)), 0)
    )
    assert explained == "  r1  20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n\tbus-off\n"


@pytest.mark.parametrize(
    ("kind", "nanoseconds", "texts"),
    [
        ("a", False, ["(0000000001.000001) ", "(0000000001.500002) ", "(0000000003.000000) "]),
        ("z", False, ["(000.000000) ", "(000.500000) ", "(001.999998) "]),
        ("d", True, ["(000.000000000) ", "(000.500000600) ", "(001.499998100) "]),
        ("", False, ["", "", ""]),
    ],
)
def test_stamps_are_candump_s(kind: str, nanoseconds: bool, texts: list[str]) -> None:
    stamps = Stamps(kind, nanoseconds=nanoseconds)
    times = (1_000_001_900, 1_500_002_500, 3_000_000_600)
    assert [stamps.text(stamp_ns) for stamp_ns in times] == texts


def test_it_ends_after_so_many_frames_that_pass_the_filter(buses, in_background, capsys) -> None:
    dumped = in_background(lambda: dump(["r1,029:7FF"], DumpOptions(count=2, log_format=True)))
    buses.await_clients(1)
    for k in range(3):
        buses.deliver(ENCODER, Frame(0x029 | RTR, bytes(k)), stamp_ns=k * 1000)
    dumped.join(10.0)
    assert capsys.readouterr().out == (
        "(0000000000.000000) r1 029#R\n(0000000000.000001) r1 029#R1\n"
    )


def test_it_ends_after_a_silence(buses, capsys) -> None:
    assert dump(["r1"], DumpOptions(silence_s=0.02)) == 0
    assert capsys.readouterr().out == ""


def test_it_ends_with_the_run_and_says_why(buses, in_background, capsys) -> None:
    statuses: list[int] = []
    dumped = in_background(lambda: statuses.append(dump(["any"], DumpOptions())))
    buses.await_clients(2)
    buses.deliver(ENCODER, bus="r2")
    buses.end()
    dumped.join(10.0)
    told = capsys.readouterr()
    assert statuses == [0]
    assert told.out == "  r2  009   [8]  00 00 80 3F 00 00 00 00\n"
    assert told.err.count("end of the run") == 2


class Pipe(io.TextIOWrapper):
    """Standard output into a pipe whose reader is about to leave."""

    def __init__(self) -> None:
        self.reader, writer = os.pipe()
        super().__init__(os.fdopen(writer, "wb"), encoding="utf-8")


@pytest.mark.parametrize("traffic", [True, False])
def test_it_ends_when_nobody_reads_any_more(buses, in_background, monkeypatch, traffic) -> None:
    pipe = Pipe()
    monkeypatch.setattr("sys.stdout", pipe)
    statuses: list[int] = []
    dumped = in_background(lambda: statuses.append(dump(["r1"], DumpOptions())))
    buses.await_clients(1)
    if traffic:
        buses.deliver(ENCODER)
        assert os.read(pipe.reader, 100).startswith(b"  r1  009")
    os.close(pipe.reader)
    dumped.join(10.0)
    assert statuses == [0]
    pipe.close()


def test_an_interrupt_ends_it_with_130(buses, monkeypatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(dumping, "_print_all", interrupted)
    assert dump(["r1"], DumpOptions()) == 130
    assert buses.until(lambda: buses.hub.clients() == 0)


def test_frames_of_other_clients_are_seen_too(buses, in_background, capsys) -> None:
    dumped = in_background(lambda: dump(["r1"], DumpOptions(count=1)))
    buses.await_clients(1)
    with can.Bus(interface="fleetloop", channel="r1") as bus:
        bus.send(can.Message(arbitration_id=0x1234567, data=b"\1", is_extended_id=True))
        dumped.join(10.0)
    assert capsys.readouterr().out == "  r1  01234567   [1]  01\n"


def test_a_bus_that_is_not_there_is_named_with_those_that_are(buses) -> None:
    with pytest.raises(InfrastructureError, match="no bus 'r9' is up; buses up now: run/r1"):
        dump(["r9"], DumpOptions())


@pytest.mark.parametrize(
    ("targets", "options", "complaint"),
    [
        (["r1"], DumpOptions(stamps="x"), "-t x"),
        (["r1"], DumpOptions(log_format=True, decode=True), "-L is for programs"),
        (["r1", "r1,123:7FF"], DumpOptions(), "named twice"),
        (["r1,oops"], DumpOptions(), "filter 'oops'"),
    ],
)
def test_what_does_not_go_together_is_refused(buses, targets, options, complaint) -> None:
    with pytest.raises(ScenarioError, match=complaint):
        dump(targets, options)
