"""Which fault applies to a frame: by identifier, direction, robot and count."""

from hypothesis import given
from hypothesis import strategies as st
from support.frame_faults import frame_fault

from bridge.frame import EFF, ERR, RTR, Frame
from bridge.frame_faults import ActingFrameFault, FrameFaults
from configs.faults.buses import FrameChange

directions = st.sampled_from(["to_drives", "from_drives", "both"])
frames = st.builds(Frame, st.sampled_from([1, 2, 3 | RTR, 2 | EFF, 1 | ERR]), st.just(b""))


@given(
    st.none() | st.integers(0, 3),
    directions,
    st.none() | st.integers(1, 10),
    st.lists(st.tuples(frames, st.booleans()), max_size=40),
)
def test_a_fault_applies_to_the_first_frames_of_its_identifier_and_direction(
    can_id: int | None, direction: str, count: int | None, sent: list[tuple[Frame, bool]]
) -> None:
    faults = FrameFaults()
    faults.replace([frame_fault("can_drop", can_id=can_id, direction=direction, count=count)])
    hit = [faults.take(frame, of_drive=of_drive) is not None for frame, of_drive in sent]
    wanted = [
        not frame.can_id & ERR
        and can_id in (None, frame.can_id & 0x1FFF_FFFF)
        and direction in ("both", "from_drives" if of_drive else "to_drives")
        for frame, of_drive in sent
    ]
    left = len(sent) if count is None else count
    for n, matches in enumerate(wanted):
        wanted[n] = matches and left > 0
        left -= wanted[n]
    assert hit == wanted
    assert bool(faults.acting) is (count is None or sum(wanted) < count)


def test_of_two_faults_the_one_that_began_first_applies_and_then_the_other() -> None:
    drop, delay = frame_fault("can_drop", count=1), frame_fault("can_delay")
    faults = FrameFaults()
    faults.replace([drop, delay])
    frame = Frame(1, b"")
    assert [faults.take(frame, of_drive=True) for _ in range(3)] == [drop, delay, delay]
    assert delay.delay_ns == 5_000_000
    faults.replace([drop, delay])  # as when another fault begins: what is used up stays so
    assert faults.acting == [delay]


def test_corruption_is_on_the_wire_and_all_others_before_it() -> None:
    faults = FrameFaults()
    faults.replace([frame_fault("can_corrupt"), frame_fault("can_duplicate")])
    found = [faults.match(Frame(1, b""), of_drive=False, on_wire=wire) for wire in (True, False)]
    assert [fault.kind for fault in found if fault] == ["can_corrupt", "can_duplicate"]


def test_on_a_shared_bus_a_fault_applies_to_the_frames_that_concern_its_robot() -> None:
    fault = FrameChange(kind="can_drop", at_s=0.0)
    acting = ActingFrameFault(fault, lambda frame: frame.can_id == 7)
    assert [acting.matches(Frame(n, b""), of_drive=True) for n in (6, 7)] == [False, True]
