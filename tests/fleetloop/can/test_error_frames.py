"""Error frames in words, by the classes of Linux' can/error.h."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.frame import ERR, Frame
from fleetloop.can.error_frames import explain


@pytest.mark.parametrize(
    ("classes", "data", "lines"),
    [
        (0x040, "0000000000000000", ["bus-off"]),
        (0x020, "0000000000000000", ["no-acknowledgement-on-tx"]),
        (0x002, "1000000000000000", ["lost-arbitration{at bit 16}"]),
        (0x004, "0030000000000000", ["controller-problem{rx-error-passive,tx-error-passive}"]),
        (
            0x088,
            "00000419000088 7F",
            [
                "protocol-violation{{bit-stuffing-error}{acknowledge-slot}}",
                "bus-error",
                "error-counter-tx-rx{{136}{127}}",
            ],
        ),
        (0x200, "0000000000000102", ["error-counter-tx-rx{{1}{2}}"]),
        (0x100, "", ["restarted-after-bus-off"]),
    ],
)
def test_classes_are_named_as_candump_names_them(classes: int, data: str, lines: list[str]) -> None:
    assert explain(Frame(ERR | classes, bytes.fromhex(data))) == lines


@given(st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8))
def test_every_error_frame_has_words_and_no_other_frame_has(bits: int, data: bytes) -> None:
    assert len(explain(Frame(ERR | bits, data))) >= (bits & 0x3FF).bit_count()
    assert explain(Frame(bits & 0x7FF, data)) == []
