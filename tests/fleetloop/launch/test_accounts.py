"""What processes reported, put together."""

from bridge.network.reports import AgentReport, PlantReport
from bridge.process.awake import Stall
from configs.events import MAX_EVENTS, Event, EventLog
from fleetloop.launch.accounts import stats_of
from fleetloop.launch.outcome import Outcome


def outcome(plant: PlantReport, agent: AgentReport) -> Outcome:
    return Outcome(reports={"plant": plant, "agent/r1": agent})


def test_a_robot_that_stops_soon_after_the_plant_stood_still_stopped_because_of_that() -> None:
    stalled = PlantReport(stalls=(Stall(200, 0.1),))
    for tick, blamed in ((150, False), (195, True), (205, True), (260, True), (300, False)):
        stopped = AgentReport(stop_reason="no encoder frames", stop_tick=tick)
        stats = stats_of(outcome(stalled, stopped), realtime=True, period_s=0.01)
        reason = stats.stopped_robots["r1"]
        assert reason.startswith("no encoder frames")
        said = "the plant, or its machine, stalled for 0.10 s at t = 2 s" in reason
        assert said == blamed, (tick, reason)
        assert stats.machine["plant_stalls"] == [{"t_s": 2.0, "lasted_s": 0.1}]


def log_of(*events: Event) -> EventLog:
    log = EventLog()
    for event in events:
        log.take(event)
    return log


def test_what_a_process_said_is_kept_if_it_did_not_live_to_report_it() -> None:
    a, b = Event(3, "r1", "stopped", "a"), Event(4, "r1", "rearming")
    c, silent = Event(2, "r2", "stopped", "c"), Event(9, "r1", "silent")
    ended = outcome(PlantReport(), AgentReport(events=(a, b), remarks=("odd",)))
    ended.said = {"agent/r1": log_of(a), "agent/r2": log_of(c)}
    ended.events = {"agent/r1": log_of(silent)}
    stats = stats_of(ended, realtime=True, period_s=0.01)
    assert stats.events == [a, b, c, silent]
    assert stats.remarks == {"r1": ["odd"]}


def test_events_that_are_not_listed_are_counted_in_the_remarks() -> None:
    ended = outcome(PlantReport(), AgentReport(remarks=("odd",)))
    silent = [Event(tick, "r1", "silent") for tick in range(MAX_EVENTS + 3)]
    ended.events = {"agent/r1": log_of(*silent)}
    stats = stats_of(ended, realtime=True, period_s=0.01)
    assert len(stats.events) == MAX_EVENTS
    said = f"3 events after the first {MAX_EVENTS} are not listed"
    assert stats.remarks == {"r1": ["odd", said]}


def test_what_the_process_before_said_comes_first() -> None:
    killed, again = Event(3, "r1", "killed"), Event(9, "r1", "rejoined")
    ended = outcome(PlantReport(), AgentReport(events=(again,)))
    ended.former = {"agent/r1": [killed]}
    assert stats_of(ended, realtime=True, period_s=0.01).events == [killed, again]


def test_a_controller_speaks_of_its_own_robot_only_and_the_plant_of_any() -> None:
    of_r2 = Event(3, "r2", "diverged", "far")
    reports = outcome(PlantReport(events=(of_r2,)), AgentReport(events=(of_r2,)))
    stats = stats_of(reports, realtime=False, period_s=0.01)
    assert [event.source for event in stats.events] == ["r2", "r1"]


def test_a_controller_that_was_told_to_stop_left_early() -> None:
    ended = outcome(PlantReport(), AgentReport(left_early="asked to stop"))
    stats = stats_of(ended, realtime=True, period_s=0.01)
    assert stats.left_early == {"r1": "asked to stop"}
