"""Status rows of robots, whatever room the terminal has."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.robot_states import robot

from fleetloop.robot_rows import Line, rows
from fleetloop.robot_states import RobotState
from fleetloop.streams import PLAIN, register


def cells(states: list[RobotState], width: int = 200) -> list[dict[str, str]]:
    """The rows' texts by their titles; two spaces part them."""
    header, *lines = (line.text for line in rows(states, width, 100))
    titles = [title.strip() for title in header.split("  ") if title]
    return [
        dict(zip(titles, [it.strip() for it in line.split("  ") if it], strict=True))
        for line in lines
    ]


def test_a_row_says_phase_errors_torque_bus_neighbours_and_drives() -> None:
    assert cells([robot("r1")]) == [
        {
            "robot": "r1",
            "phase": "driving",
            "|x_e| m": "0.012",
            "|y_e| m": "0.500",
            "τ N·m": "-0.52",
            "bus": "34 %",
            "heard": "10 ms",
            "drives": "closed loop control",
        }
    ]


@pytest.mark.parametrize(
    "changes, title, text",
    [
        ({"x_e_m": None}, "|x_e| m", "-"),
        ({"x_e_m": 1234567.0}, "|x_e| m", "1.2e+06"),
        ({"right_wheel_N_m": 700.0}, "τ N·m", "+700.0"),
        ({"bus_load": None}, "bus", "420/s"),
        ({"bus_load": None, "bus_frames_per_s": 4200.0}, "bus", "4.2k/s"),
        ({"bus_load": None, "bus_frames_per_s": None}, "bus", "-"),
        ({"neighbour_age_s": 2.5}, "heard", "2.5 s"),
        ({"neighbour_age_s": None}, "heard", "never"),
        ({"neighbour_age_s": None, "neighbours": {}}, "heard", "-"),
        ({"left_drive": "IDLE: ESTOP"}, "drives", "right closed loop control, left idle: ESTOP"),
        ({"right_drive": "", "left_drive": ""}, "drives", "-"),
        ({"phase": ""}, "phase", "starting"),
    ],
)
def test_values_are_short(changes, title: str, text: str) -> None:
    assert cells([robot("r1", **changes)])[0][title] == text


def test_where_there_is_room_all_are_shown_in_the_order_of_the_scenario() -> None:
    states = [robot("b", x_e_m=0.1), robot("a", x_e_m=9.0), robot("c", phase="stopped")]
    assert [row["robot"] for row in cells(states)] == ["b", "a", "c"]


def test_otherwise_those_to_be_looked_at_are_and_the_others_are_counted() -> None:
    states = [robot(f"r{n}", x_e_m=0.001 * n) for n in range(249)]
    states[3] = robot("r3", phase="stopped", x_e_m=0.0)
    states[7] = robot("r7", phase="rearming", x_e_m=0.0)
    header, *shown, last = rows(states, 80, 10)
    assert [line.text.split()[0] for line in shown] == [
        *("r3", "r7", "r243", "r244", "r245", "r246", "r247", "r248")
    ]
    assert last.text == "+ 241 more: 241 driving, at most 0.555 m off"
    assert [line.style for line in shown[:3]] == ["bold red", "yellow", ""]
    assert (
        len({header.text.index("phase"), *(line.text.index("driving") for line in shown[2:])}) == 1
    )


def test_a_narrow_terminal_loses_the_least_important_columns_first() -> None:
    titles = [
        {it.strip() for it in rows([robot("r1")], width, 5)[0].text.split("  ") if it}
        for width in range(120, 23, -1)
    ]
    assert all(narrower <= wider for wider, narrower in pairwise(titles))
    assert titles[40] >= {"|x_e| m", "τ N·m", "bus", "heard", "drives"}  # of 80 columns
    assert titles[-1] == {"robot", "phase", "|x_e| m"}


phases = st.sampled_from(["", "arming", "driving", "stopped", "absent", "x" * 48])
values = st.none() | st.floats(allow_nan=False, allow_infinity=False)
robots = st.builds(
    robot,
    st.text("abr1", min_size=1, max_size=40),
    phase=phases,
    x_e_m=values,
    right_wheel_N_m=values,
    bus_load=st.none() | st.floats(0.0, 2.0),
    bus_frames_per_s=st.none() | st.floats(0.0, 1e9),
    neighbour_age_s=st.none() | st.floats(0.0, 1e6),
    left_drive=st.text("AB_:", max_size=48),
)


@given(st.lists(robots, max_size=12), st.integers(0, 130), st.integers(-3, 16))
def test_no_line_is_longer_or_more_than_there_is_room(states, width: int, height: int) -> None:
    lines = rows(states, width, height)
    assert len(lines) <= max(height, 0)
    assert all(len(line.text) <= width for line in lines)


def test_where_the_terminal_lacks_letters_they_are_spelled_and_columns_stay_in_line() -> None:
    register()

    def spelled(text: str) -> str:
        return text.encode("ascii", PLAIN).decode()

    header, row = rows([robot("r1")], 80, 5, spelled)
    assert header.text.isascii()
    assert "tau N.m" in header.text
    assert header.text.index("drives") == row.text.index("closed")


def test_nobody_gets_no_header() -> None:
    assert rows([], 80, 24) == []
    assert rows([robot("r1")], 10, 24) == []
    assert all(isinstance(line, Line) for line in rows([robot("r1")], 80, 24))
