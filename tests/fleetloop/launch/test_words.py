"""What a launcher hears of its processes: nothing they say ends it or fools its terminal."""

from math import inf, nan

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.network.link import Dropped
from bridge.network.messages import MAX_TEXT, Progress, Report
from configs.loading import load
from configs.resolve import schedule
from fleetloop.launch.accounts import stats_of
from fleetloop.launch.process_run import Outcome
from fleetloop.launch.words import Words

SCENARIO = load("two_robots")
SCHEDULE = schedule(SCENARIO)


def said(values: object) -> bytes:
    packed: bytes = msgpack.packb([1, values])
    return packed


@pytest.mark.parametrize(
    "values",
    [
        {"misses": inf},
        {"misses": -inf},
        {"cpu_ns": nan},
        {"ticks": 2**63},
        {"ticks": True},
        {"ticks": None},
        {"ticks": [1]},
        {"stopped": b"bytes"},
        {"stopped": "x" * (MAX_TEXT + 1)},
        {"x" * 1000: 1},
        {1: 1},
        {f"name {n}": n for n in range(5000)},
        "text",
        [],
    ],
    ids=lambda values: str(values)[:20],
)
def test_a_report_with_what_is_no_counter_is_refused_and_its_sender_named(values) -> None:
    words = Words(SCHEDULE)
    assert words.report("agent/r1", said(values)) is None
    assert words.refusals.lines() == ["refused 1 report of agent/r1: not well formed"]


def test_what_a_terminal_would_obey_is_replaced_in_names_and_texts() -> None:
    report = Words(SCHEDULE).report(
        "agent/r1", said({"not\x1b[2Jices": "1st\n\x1b]0;owned\x07\x9b31m\u202e2nd\x7f"})
    )
    assert report is not None
    ((name, text),) = report.values.items()
    assert name == "not\ufffd[2Jices"
    assert text == "1st\n\ufffd]0;owned\ufffd\ufffd31m\ufffd2nd\ufffd"


def test_an_honest_report_that_is_too_long_arrives_without_its_end() -> None:
    report = Report.decode(Report({"notices": "x" * 10 * MAX_TEXT}).encode())
    assert report == Report({"notices": "x" * MAX_TEXT})


@pytest.mark.parametrize(
    "progress",
    [
        Progress(SCHEDULE.ticks + 1, 0, 0),
        Progress(-SCHEDULE.countdown_ticks - 1, 0, 0),
        Progress(2**62, 0, 0),
        Progress(10, 11 * SCHEDULE.period_ns, 0),
        Progress(10, 10 * SCHEDULE.period_ns, -1),
    ],
)
def test_progress_beyond_the_run_is_refused(progress: Progress) -> None:
    words = Words(SCHEDULE)
    assert words.progress("plant", progress.encode()) is None
    (line,) = words.refusals.lines()
    assert line.startswith("refused 1 progress message of plant: ti")


def test_progress_within_the_run_is_heard() -> None:
    for tick in (-SCHEDULE.countdown_ticks, 0, SCHEDULE.ticks):
        for t_ns in (0, tick * SCHEDULE.period_ns):  # the recorder says no time
            progress = Progress(tick, t_ns, 5)
            assert Words(SCHEDULE).progress("plant", progress.encode()) == progress


def test_what_found_no_room_is_counted_by_its_sender() -> None:
    words = Words(SCHEDULE)
    words.note_dropped([Dropped("progress", "fleetloop/run/@progress/agent/r1", 40_000)])
    assert words.refusals.lines() == [
        "refused 40000 progress messages of agent/r1: more than anybody could read"
    ]


values = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
NAMES = """cpu_ns bus_ns misses skipped overruns frames.r1 trouble.r1 stopped stopped.r1 notices
refused profile.law profile.x early failure ticks stall.3 stall.-7 stopped_tick"""
names = st.sampled_from(NAMES.split()) | st.text(max_size=8)


@given(
    st.dictionaries(
        st.sampled_from(["plant", "recorder", "agent/r1", "agent/r2"]),
        st.dictionaries(names, values | st.text(max_size=8), max_size=8),
    )
)
def test_whatever_roles_report_there_are_statistics(reports) -> None:
    decoded = {process: Report.decode(said(report)) for process, report in reports.items()}
    outcome = Outcome(reports={p: report for p, report in decoded.items() if report is not None})
    for realtime in (False, True):
        stats_of(outcome, realtime=realtime, period_s=0.01)
