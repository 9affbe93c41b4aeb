"""What processes reported, put together."""

from bridge.network.reports import AgentReport, PlantReport
from bridge.process.awake import Stall
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


def test_what_a_process_said_is_kept_if_it_did_not_live_to_report_it() -> None:
    ended = outcome(PlantReport(), AgentReport(notices=("a", "b")))
    ended.said = {"agent/r1": ["a"], "agent/r2": ["c"]}
    ended.notices = {"agent/r1": ["no sign of life"]}
    stats = stats_of(ended, realtime=True, period_s=0.01)
    assert stats.notices == {"r1": ["a", "b", "no sign of life"], "r2": ["c"]}


def test_a_controller_that_was_told_to_stop_left_early() -> None:
    ended = outcome(PlantReport(), AgentReport(left_early="asked to stop"))
    stats = stats_of(ended, realtime=True, period_s=0.01)
    assert stats.left_early == {"r1": "asked to stop"}
