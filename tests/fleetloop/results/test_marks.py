"""What is marked on time axes: a fault over its window, an instant where it is."""

import pytest

from configs.loading import load
from fleetloop.results.marks import marks_of

FAULTS = (
    '{kind="push", at_s=1.0, for_s=0.5}',
    '{kind="encoder_jump", at_s=2.0}',
    '{kind="payload", at_s=3.0}',
)
ROWS = [
    {"name": "push", "kind": "push", "targets": ["r1"], "from_s": 1.0, "to_s": 1.5},
    {
        "name": "encoder_jump",
        "kind": "encoder_jump",
        "targets": ["r1"],
        "from_s": 2.0,
        "to_s": None,
    },
    {"name": "payload", "kind": "payload", "targets": ["r1"], "from_s": 3.0, "to_s": None},
]


@pytest.mark.parametrize("summary", [{}, {"faults": ROWS}], ids=["planned", "as they were"])
def test_a_fault_is_marked_over_its_window_and_an_instant_where_it_is(summary) -> None:
    scenario = load("two_robots", (f"fault=[{', '.join(FAULTS)}]",))
    marks = marks_of(summary, scenario, 4.0)
    assert [(one.name, one.from_s, one.to_s) for one in marks.faults] == [
        ("push", 1.0, 1.5),
        ("encoder_jump", 2.0, 2.0),
        ("payload", 3.0, 4.0),
    ]
    assert [one.text.rpartition(", ")[2] for one in marks.faults] == [
        *("from 1 s to 1.5 s", "at 2 s", "from 3 s to the end"),
    ]
