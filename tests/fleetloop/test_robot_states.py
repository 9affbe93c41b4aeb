"""What is to be seen of the robots of a run."""

import pytest
from support.in_process import RanInProcess

from bridge.network import keys
from bridge.network.link import Arrival
from bridge.network.messages import Progress
from bridge.network.status import (
    BusStatus,
    ControllerStatus,
    DriveStatus,
    Heard,
    PlantStatus,
)
from configs.loading import load
from configs.resolve import schedule
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.remote_roles import RemoteRoles
from fleetloop.robot_states import RobotBoard, buses_of

DRIVING = ControllerStatus("driving", 0.1, -0.2, 0.3, 0.4, 0.5, (Heard("r1", 0.01),))
DRIVES = (DriveStatus("r1", "ON", "ON"), DriveStatus("r2", "ON", "OFF: e-stop"))
PLANT = PlantStatus((BusStatus("fleet", 900, 400.0, 0.25),), DRIVES)


def board() -> RobotBoard:
    return RobotBoard({"r1": "fleet", "r2": "fleet"})


def test_of_robots_that_nobody_spoke_of_only_name_and_bus_are_known() -> None:
    (first, _) = board().states()
    assert (first.robot, first.bus, first.phase, first.tick) == ("r1", "fleet", "", None)
    assert first.x_e_m is first.bus_load is first.neighbour_age_s is None


def test_the_words_of_controllers_and_plant_meet_in_the_state_of_a_robot() -> None:
    seen = board()
    seen.note("agent/r2", Progress(7, 0, 0, DRIVING))
    seen.note("plant", Progress(8, 0, 0, PLANT))
    _, second = seen.states()
    assert (second.phase, second.tick, second.y_e_m) == ("driving", 7, -0.2)
    assert (second.neighbour_age_s, second.neighbours) == (0.01, {"r1": 0.01})
    assert (second.bus_load, second.bus_frames_per_s) == (0.25, 400.0)
    assert (second.right_drive, second.left_drive) == ("ON", "OFF: e-stop")


def test_a_process_speaks_of_itself_only() -> None:
    seen = board()
    seen.note("agent/r2", Progress(7, 0, 0, PLANT))
    seen.note("agent/r9", Progress(7, 0, 0, DRIVING))
    seen.note("plant", Progress(7, 0, 0, DRIVING))
    assert seen.states() == board().states()


def test_progress_without_a_status_changes_nothing() -> None:
    seen = board()
    seen.note("agent/r2", Progress(7, 0, 0, DRIVING))
    before = seen.states()
    seen.note("agent/r2", Progress(9, 0, 0))
    assert seen.states() == before


def test_the_launcher_says_which_controllers_it_goes_on_without() -> None:
    scenario = load("two_robots")
    plane = ControlPlane(
        schedule(scenario),
        RemoteRoles({}, 0.0),
        RobotBoard(buses_of(scenario)),
        lambda: 0.0,
        lambda _: None,
        lambda _: None,
        lambda *_: None,
    )

    def say(robot: str) -> None:
        key = keys.progress("run", f"agent/{robot}")
        plane.process(Arrival("progress", key, Progress(7, 0, 0, DRIVING).encode()))

    def phases() -> list[str]:
        return [state.phase for state in plane.robots()]

    plane.alive |= {"agent/r1", "agent/r2"}
    say("r1")
    say("r2")
    plane.process(Arrival("progress", keys.progress("run", "plant"), Progress(7, 0, 0).encode()))
    assert phases() == ["driving", "driving"]
    plane.held.add("agent/r1")
    assert phases() == ["held", "driving"]
    plane.alive.remove("agent/r2")
    assert phases() == ["held", "absent"]


def test_in_process_it_is_what_the_record_has_and_the_wire_was_busy_with() -> None:
    ran = RanInProcess(load("realistic", ("duration_s=0.5", "expect=[]", "bus.record=[]")))
    states = ran.run.robots()
    assert [state.robot for state in states] == ["r1", "r2", "r3", "r4"]
    assert {state.phase for state in states} == {"done"}
    for state in states:
        row = {name: column[-1] for name, column in ran.controller(state.robot).items()}
        assert (state.x_e_m, state.theta_e_rad) == (row["x_e_m"], row["theta_e_rad"])
        assert state.bus_load is not None
        wire = ran.run._buses[state.bus].wire
        assert state.bus_load == pytest.approx(wire.load)  # its first status is of all time
        assert state.bus_frames_per_s == pytest.approx(
            ran.run.frames[state.bus] * 1e9 / wire.now_ns
        )
        assert state.right_drive == "IDLE"
    assert [list(state.neighbours) for state in states] == [[], ["r1"], ["r2"], ["r3"]]


def test_without_bit_timing_a_bus_has_a_rate_but_no_load() -> None:
    ran = RanInProcess(load("two_robots", ("duration_s=0.2", "expect=[]", "bus.record=[]")))
    for state in ran.run.robots():
        assert state.bus_load is None
        assert state.bus_frames_per_s is not None
        assert state.bus_frames_per_s > 2 * 2 / 0.01
