"""Marks on figures for papers."""

from pathlib import Path

import pytest

from configs.events import Event
from configs.loading import load
from fleetloop.record.reader import Record
from fleetloop.results.figures import all_figures
from fleetloop.results.summary import RunStats, summarise

PUSH = {"kind": "push", "name": "shove", "at_s": 1.0, "for_s": 0.5}
BOUND = {"signal": "x_e_m", "max_abs": 0.05, "from_s": 2.0}


def test_faults_events_and_bounds_are_marked_over_time_and_the_caption_says_so(
    finished_run: Path,
) -> None:
    scenario = load("two_robots").with_(fault=[PUSH], expect=[BOUND])
    record = Record.open(finished_run / "record.mcap")
    events = [Event(600, "r1", "stopped", "for a reason")]
    summary = summarise(record, scenario, RunStats("lockstep", events=events))
    made = {one.name: one for one in all_figures(record, scenario, summary)}
    (axes, *_) = made["x_e"].figure.axes
    (shaded,) = axes.patches
    assert shaded.get_x() == pytest.approx(1.0)
    assert shaded.get_width() == pytest.approx(0.5)
    at = 600 * scenario.clock.control_period_s
    drawn = [path.vertices.tolist() for one in axes.collections for path in one.get_paths()]
    assert sorted(drawn) == [
        [[at, 0.0], [at, 1.0]],
        *([[2.0, level], [3.998, level]] for level in (-0.05, 0.05)),
    ]
    assert made["x_e"].caption.endswith(
        "Shaded: faults; dotted: events, red for those that are bad; dashed: what was expected."
    )
    assert made["y_e"].caption.endswith("dotted: events, red for those that are bad.")
    assert "Shaded" not in made["graph"].caption + made["positions"].caption


def test_figures_of_a_record_alone_have_no_marks(finished_run: Path) -> None:
    record = Record.open(finished_run / "record.mcap")
    for one in all_figures(record, load("two_robots").with_(fault=[PUSH])):
        assert "Shaded" not in one.caption
