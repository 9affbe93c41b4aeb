"""candump's filters with the kernel's rules; the examples are those of candump's own help."""

import pytest

from bridge.frame import EFF, ERR, RTR
from configs.errors import ScenarioError
from fleetloop.can.filters import parse


@pytest.mark.parametrize(
    ("text", "shown", "hidden"),
    [
        ("r1", [0x123, EFF | 5, RTR | 1, ERR | 0x40, ERR], []),
        ("r1,123:7FF", [0x123, EFF | 0x123, RTR | 0x123], [0x124, ERR | 0x123]),
        ("r1,123:C00007FF", [0x123], [EFF | 0x123, RTR | 0x123]),
        ("r1,12345678:DFFFFFFF", [EFF | 0x12345678], [0x678, EFF | RTR | 0x12345678]),
        ("r1,400~7F0", [0x123, 0x410], [0x400, 0x40F]),
        ("r1,123:7FF,400:700", [0x123, 0x4AB], [0x124]),
        ("r1,400:700,40F~7FF,j", [0x400], [0x40F, 0x123]),
        ("r1,0~0,#FFFFFFFF", [ERR | 0x40], [0x123, EFF | 5]),
        ("r1,0:0,#40", [0x123, EFF | 5, ERR | 0x40], [ERR | 0x20]),
    ],
)
def test_filters_show_what_candump_would(text: str, shown: list[int], hidden: list[int]) -> None:
    bus, passing = parse(text)
    assert bus == "r1"
    assert [passing.passes(can_id) for can_id in shown] == [True] * len(shown)
    assert [passing.passes(can_id) for can_id in hidden] == [False] * len(hidden)


@pytest.mark.parametrize("text", ["r1,", "r1,xyz", "r1,123", "r1,123:", "r1,123456789:7FF", "r1,#"])
def test_a_wrong_filter_is_named(text: str) -> None:
    with pytest.raises(ScenarioError, match="ID:MASK"):
        parse(text)


def test_a_bus_must_be_named() -> None:
    with pytest.raises(ScenarioError, match="names no bus"):
        parse(",123:7FF")
