"""What a launcher hears of its processes: nothing they say ends it or fools its terminal."""

from math import inf, nan

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.network.link import Dropped
from bridge.network.messages import Progress
from bridge.network.reports import (
    MAX_TEXT,
    AgentReport,
    Deadlines,
    PlantReport,
    Report,
    decode_report,
)
from bridge.process.awake import Stall
from configs.events import KINDS, MAX_EVENTS, Event
from configs.loading import load
from configs.resolve import schedule
from fleetloop.launch.accounts import stats_of
from fleetloop.launch.message_reader import MessageReader
from fleetloop.launch.outcome import Outcome

SCENARIO = load("two_robots")
SCHEDULE = schedule(SCENARIO)


HONEST = ["", "", [], [], [], [], 0, {}, {}]
OWN = {"plant": [0, {}, {}, {}, [], {}], "agent/r1": ["", 0, None, {}]}


def said(process: str, changes: dict[int, object]) -> bytes:
    """A report of that process with other values at some places of its layout."""
    fields = dict(enumerate([1, *HONEST, *OWN.get(process, [])])) | changes
    packed: bytes = msgpack.packb(list(fields.values()))
    return packed


@pytest.mark.parametrize(
    "process, changes",
    [
        ("agent/r1", {0: 2}),
        ("agent/r1", {1: b"bytes"}),
        ("agent/r1", {1: "x" * (MAX_TEXT + 1)}),
        ("agent/r1", {4: ["x" * MAX_TEXT, "x"]}),
        ("agent/r1", {4: "text"}),
        ("agent/r1", {3: "text"}),
        ("agent/r1", {3: [[0, "r1", "exploded", ""]]}),
        ("agent/r1", {3: [[0, "r1", "stopped"]]}),
        ("agent/r1", {3: ["stopped"]}),
        ("agent/r1", {3: [[0, "r1", "stopped", ""]] * (MAX_EVENTS + 1)}),
        ("agent/r1", {7: inf}),
        ("agent/r1", {7: nan}),
        ("agent/r1", {7: 2**63}),
        ("agent/r1", {7: True}),
        ("agent/r1", {7: None}),
        ("agent/r1", {8: {"x" * 1000: 1}}),
        ("agent/r1", {8: {1: 1}}),
        ("agent/r1", {8: {"bus": 0.5}}),
        ("agent/r1", {9: {f"name {n}": n for n in range(5000)}}),
        ("agent/r1", {12: [1]}),
        ("agent/r1", {13: 0}),
        ("agent/r1", {13: {"r2": {"sent": 0.5}}}),
        ("agent/r1", {13: {"r2": 5}}),
        ("plant", {12: {"r1": 1}}),
        ("plant", {14: [[200, inf]]}),
        ("plant", {14: [[200]]}),
        ("plant", {14: [[n, 0.1] for n in range(1000)]}),
        ("recorder", {10: 0}),
    ],
)
def test_a_report_that_is_none_is_refused_and_its_sender_named(process, changes) -> None:
    words = MessageReader(SCHEDULE)
    assert words.report(process, said(process, changes)) is None
    assert words.refusals.lines() == [f"refused 1 report of {process}: not well formed"]


def test_no_process_can_send_the_report_of_another_role() -> None:
    words = MessageReader(SCHEDULE)
    assert isinstance(words.report("plant", said("plant", {})), PlantReport)
    assert isinstance(words.report("agent/r1", said("agent/r1", {})), AgentReport)
    assert words.report("agent/r1", said("plant", {})) is None


def test_what_a_terminal_would_obey_is_replaced_in_names_and_texts() -> None:
    texts = {4: ["1st\n\x1b]0;owned\x07\x9b31m\u202e2nd\x7f"], 8: {"b\x1b[2Jus": 1}}
    report = MessageReader(SCHEDULE).report("agent/r1", said("agent/r1", texts))
    assert report is not None
    assert report.remarks == ("1st\n\ufffd]0;owned\ufffd\ufffd31m\ufffd2nd\ufffd",)
    assert report.durations_ns == {"b\ufffd[2Jus": 1}


def test_an_honest_report_that_is_too_long_arrives_without_its_end() -> None:
    remarks = ("x" * (MAX_TEXT - 1), "yz", "nothing of this")
    report = AgentReport.decode(AgentReport(remarks=remarks, failure="x" * 2 * MAX_TEXT).encode())
    assert report == AgentReport(remarks=("x" * (MAX_TEXT - 1), "y"), failure="x" * MAX_TEXT)


def test_of_too_many_or_too_long_events_the_first_arrive_and_what_their_texts_have_room_for() -> (
    None
):
    events = tuple(Event(tick, "r1", "stopped", "x" * 300) for tick in range(MAX_EVENTS + 9))
    report = AgentReport.decode(AgentReport(events=events).encode())
    assert report is not None
    assert [event.tick for event in report.events] == list(range(MAX_EVENTS))
    assert sum(len(event.text) for event in report.events) == MAX_TEXT


names = st.text(max_size=8)
counts = st.dictionaries(names, st.integers(-(2**63), 2**63 - 1), max_size=4)
texts = st.lists(names, max_size=4).map(tuple)
events = st.builds(Event, st.integers(-9, 2**40), names, st.sampled_from(sorted(KINDS)), names)
common = {
    "failure": names,
    "left_early": names,
    "events": st.lists(events, max_size=4).map(tuple),
    "remarks": texts,
    "flooders": texts,
    "missing_privileges": texts,
    "cpu_ns": st.integers(0, 2**62),
    "durations_ns": counts,
    "profile_ns": counts,
}
stalls = st.builds(Stall, st.integers(-9, 2**40), st.floats(0.0, 1e9))
by_name = st.dictionaries(names, names, max_size=4)
reports = st.fixed_dictionaries(
    {
        "plant": st.builds(
            PlantReport,
            **common,
            overruns=st.integers(0, 9),
            frames=counts,
            stopped_robots=by_name,
            bus_troubles=by_name,
            stalls=st.lists(stalls, max_size=4).map(tuple),
            nodes=st.dictionaries(st.sampled_from(["r1/r1", "r1/r1 left"]), counts, max_size=2),
        ),
        "agent/r1": st.builds(
            AgentReport,
            **common,
            stop_reason=names,
            stop_tick=st.integers(-9, 2**40),
            deadlines=st.none() | st.builds(Deadlines, st.integers(0, 9), st.integers(0, 9)),
            messages=st.dictionaries(st.sampled_from(["r2", "leader"]), counts, max_size=2),
        ),
        "recorder": st.builds(Report, **common),
    }
)


@given(reports)
def test_whatever_roles_report_arrives_and_there_are_statistics(reports) -> None:
    heard = {process: decode_report(process, it.encode()) for process, it in reports.items()}
    assert {type(report) for report in heard.values()} == {PlantReport, AgentReport, Report}
    assert heard["plant"].stalls == reports["plant"].stalls
    assert heard["agent/r1"].deadlines == reports["agent/r1"].deadlines
    for realtime in (False, True):
        stats_of(Outcome(reports=heard), realtime=realtime, period_s=0.01)


@given(st.sampled_from(["plant", "recorder", "agent/r1"]), st.binary(max_size=64))
def test_no_bytes_on_a_report_key_raise(process: str, payload: bytes) -> None:
    MessageReader(SCHEDULE).report(process, payload)


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
    words = MessageReader(SCHEDULE)
    assert words.progress("plant", progress.encode()) is None
    (line,) = words.refusals.lines()
    assert line.startswith("refused 1 progress message of plant: ti")


def test_progress_within_the_run_is_heard() -> None:
    for tick in (-SCHEDULE.countdown_ticks, 0, SCHEDULE.ticks):
        for t_ns in (0, tick * SCHEDULE.period_ns):  # the recorder says no time
            progress = Progress(tick, t_ns, 5)
            assert MessageReader(SCHEDULE).progress("plant", progress.encode()) == progress


def test_what_found_no_room_is_counted_by_its_sender() -> None:
    words = MessageReader(SCHEDULE)
    words.note_dropped([Dropped("progress", "fleetloop/run/@progress/agent/r1", 40_000)])
    assert words.refusals.lines() == [
        "refused 40000 progress messages of agent/r1: more than can be read"
    ]
