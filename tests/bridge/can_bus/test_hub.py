"""The hub against clients that don't keep to anything: raw sockets that write what they like."""

import struct
import threading

import pytest
from support.strangers import SECRET, Serving

from bridge.can_bus import hub
from bridge.can_bus.connection import TURN
from bridge.can_bus.packet import DONE, MAX_FRAMES, SYNCHRONOUS, WELCOME, Transmitted, encode_frames
from bridge.frame import ERR, RTR, Frame

# --- much between two questions -------------------------------------------------------------------


@pytest.mark.parametrize("queue", [0, 10])
@pytest.mark.parametrize("count", [1, 1024, 1025, 5000, 66_000])
def test_a_controller_is_asked_whatever_others_said_between_two_questions(
    runtime_folder, queue: int, count: int
) -> None:
    serving = Serving(queue)
    controller = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    stranger = serving.join()
    for packet in (controller, stranger):
        assert packet.hear().kind == WELCOME
    said = [Frame(n % 0x800, n.to_bytes(4, "big")) for n in range(count)]
    heard: list[Frame] = []

    def read() -> None:
        heard.extend(controller.hear_question())

    if queue:
        reader = threading.Thread(target=read)
        reader.start()
        serving.hub.forward("r1", 9, [Transmitted(9, frame, key=2) for frame in said], "r1")
    else:
        for first in range(0, count, MAX_FRAMES):
            stranger.frames(*said[first : first + MAX_FRAMES])
            serving.serve()
        reader = threading.Thread(target=read)
        reader.start()
        serving.hub.deliver("r1", 9, (Frame(0x009, b""),))
        said.append(Frame(0x009, b""))
    while reader.is_alive():
        serving.hub.collect(0.01)
    assert heard == said
    controller.frames(Frame(0x00E, b""), flags=DONE, stamp_ns=9)
    assert any(serving.hub.collect(0.5) for _ in range(10))
    serving.close()


def test_replies_of_drives_to_very_many_requests_reach_the_controller(serving) -> None:
    controller = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    assert controller.hear().kind == WELCOME
    replies = [Frame(n % 0x800, n.to_bytes(4, "big")) for n in range(66_000)]
    heard: list[Frame] = []
    reader = threading.Thread(target=lambda: heard.extend(controller.hear_question()))
    reader.start()
    serving.hub.deliver("r1", 9, replies)
    while reader.is_alive():
        serving.hub.collect(0.01)
    assert heard == replies


def test_what_a_controller_says_is_taken_at_once_and_what_others_say_a_turn_at_a_time(
    serving,
) -> None:
    controller = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    stranger = serving.join()
    said = [Frame(n % 0x700, n.to_bytes(4, "big")) for n in range(10_000)]
    for first in range(0, len(said), 1000):
        stranger.frames(*said[first : first + 1000])
        serving.serve()
    controller.frames(Frame(0x70E, b""))
    serving.serve()
    first = serving.hub.receive("r1")
    assert Frame(0x70E, b"") in first
    first.remove(Frame(0x70E, b""))
    assert len(first) < 2 * TURN
    taken = first
    while serving.hub.pending():
        more = serving.hub.receive("r1")
        assert len(more) <= TURN
        taken += more
    assert taken == said


def test_who_says_more_than_is_taken_is_not_read_until_it_is(
    serving, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hub, "UNTAKEN", 100)
    flood, quiet = serving.join(), serving.join()
    flood.socket.setblocking(False)
    sent = 0
    with pytest.raises(BlockingIOError):
        while sent < 100_000:
            flood.frames(Frame(1, sent.to_bytes(4, "big")))
            sent += 1
            serving.hub.serve(0.0)
    assert 100 < sent < 2000  # what a socket holds, and no more
    quiet.frames(Frame(2, b""))
    taken: list[Frame] = []
    for _ in range(sent):
        serving.hub.serve(0.0)
        taken += serving.hub.receive("r1")
    ours = [int.from_bytes(frame.data, "big") for frame in taken if frame.can_id == 1]
    assert ours == list(range(sent))
    assert Frame(2, b"") in taken


# --- what is no frame -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("can_id", "length"), [(0x802, 4), (0x123, 9), (ERR | RTR, 0), (RTR | 0x800, 0)]
)
@pytest.mark.parametrize("queue", [0, 10])
def test_what_is_no_classic_frame_is_counted_and_goes_nowhere(
    runtime_folder, can_id: int, length: int, queue: int
) -> None:
    serving = Serving(queue)
    stranger, other = serving.join(), serving.join()
    packet = bytearray(encode_frames(0, 0, [Frame(1, b"a"), Frame(2, b"b"), Frame(3, b"c")]))
    packet[32:37] = struct.pack("<IB", can_id, length)
    stranger.say(bytes(packet))
    serving.serve()
    good = [Frame(1, b"a"), Frame(3, b"c")]
    if queue:
        assert [said.frame for said in serving.hub.submitted("r1")] == good
    else:
        assert serving.hub.receive("r1") == good
        assert other.hear().kind == WELCOME
        assert [other.hear().frames for _ in good] == [(frame,) for frame in good]
    assert "1 × what is no frame" in serving.hub.troubles()["r1"]
    serving.close()


def test_with_bit_timing_an_error_frame_is_for_the_wire(runtime_folder) -> None:
    serving = Serving(10)
    serving.join().frames(Frame(ERR | 4, bytes(8)))
    serving.serve()
    assert [said.frame for said in serving.hub.submitted("r1")] == [Frame(ERR | 4, bytes(8))]
    serving.close()
