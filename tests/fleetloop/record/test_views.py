"""Views of a record as a stock reader has them: what is drawn is what the rows say."""

from collections.abc import Iterable
from math import cos, nan, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from support.controller_rows import SIGNALS

from configs.brief import Drawing, DrawnRobot, Wheels
from configs.paths import Circle, World
from configs.signals import PLANT_SIGNALS, USED_SIGNALS, Signal, age_signals
from fleetloop.record.writer import VIEW_INSTANTS, RecordWriter, finish_truncated

PERIOD_NS = 2_000_000
TICKS = 1100  # more than two groups of a record's; the last one is cut
MESSAGES = 44  # every 25 ticks
ROBOTS = ("r1", "r2")
AGED = (*USED_SIGNALS, *age_signals(["r1"]), *SIGNALS[len(USED_SIGNALS) :])
TABLES = {"r1": SIGNALS, "r2": AGED}
CIRCLE = (Circle(kind="circle", radius_m=2.0), World(kind="world", x_m=1.0))
DRAWING = Drawing(
    (
        DrawnRobot("#0072b2", Wheels(0.05, 0.2), CIRCLE, (0.0, 4.0 * pi)),
        DrawnRobot("#d55e00", Wheels(0.04, 0.1)),
    ),
    (("r1", "r2", None), ("r2", "r1", ((0, 100), (600, 1 << 62)))),
    2.0,
)


def column(table: Iterable[Signal], name: str) -> int:
    return [signal.name for signal in table].index(name)


def plant(robot: str, ticks: int = TICKS) -> np.ndarray:
    """r1 goes along x and turns; r2 stands at (0, −1)."""
    t = np.arange(ticks) * 2e-3
    rows = np.zeros((ticks, len(PLANT_SIGNALS)))
    rows[:, 0] = t
    if robot == "r1":
        rows[:, 1], rows[:, 3] = 0.6 * t, 0.25 * t
    else:
        rows[:, 2] = -1.0
    return rows


def controller(robot: str, ticks: int = TICKS) -> np.ndarray:
    """Of both s = 0.6 t, of r2 half a metre less; references at (s, 7, 0.1)."""
    t = np.arange(ticks) * 2e-3
    table = TABLES[robot]
    rows = np.zeros((ticks, len(table)))
    s = 0.6 * t - (0.5 if robot == "r2" else 0.0)
    for name, values in {"t_s": t, "s": s, "x_d_m": s, "y_d_m": 7.0, "theta_d_rad": 0.1}.items():
        rows[:, column(table, name)] = values
    if robot == "r2":
        rows[:, column(table, "age_of_r1_s")] = 0.5
    return rows


def messages(path: Path, rows: dict[tuple[str, str], np.ndarray], drawing: Drawing = DRAWING):
    """Every message by topic, with its log time, of a record of these rows."""
    with RecordWriter(path, TABLES, "", PERIOD_NS, drawing=drawing) as writer:
        for (robot, source), table in rows.items():
            writer.add(robot, source, 0, table.tobytes())
    return read(path)


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Every message by topic, with its log time."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, content))
    return found


def all_rows() -> dict[tuple[str, str], np.ndarray]:
    made = {(robot, "plant"): plant(robot) for robot in ROBOTS}
    return made | {(robot, "controller"): controller(robot) for robot in ROBOTS}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[tuple[int, Any]]]:
    return messages(tmp_path_factory.mktemp("views") / "a.mcap", all_rows())


def entities(update: Any) -> dict[str, Any]:
    return {entity.id: entity for entity in update.entities}


def place(pose: Any) -> tuple[float, float]:
    return pose.position.x, pose.position.y


def heading(pose: Any) -> float:
    """Of a pose turned about z alone."""
    assert (pose.orientation.x, pose.orientation.y) == (0.0, 0.0)
    return 2.0 * np.arctan2(pose.orientation.z, pose.orientation.w)


def test_every_view_has_a_message_every_50_ms_of_scenario_time(found) -> None:
    for topic in ("scene/robots", "scene/references", "scene/edges", "tf", "fleet"):
        times_ns = [t_ns for t_ns, _ in found[topic]]
        assert times_ns == [n * 50_000_000 for n in range(MESSAGES)]
    assert [t_ns for t_ns, _ in found["scene/paths"]] == [0]


def test_robots_are_drawn_where_their_rows_say(found) -> None:
    for t_ns, update in found["scene/robots"]:
        drawn, t = entities(update), t_ns * 1e-9
        assert list(drawn) == ["robot r1", "robot r2"]
        r1 = drawn["robot r1"]
        assert (r1.frame_id, r1.frame_locked) == ("world", False)
        assert r1.timestamp.sec * 10**9 + r1.timestamp.nanosec == t_ns
        assert (r1.lifetime.sec, r1.lifetime.nanosec) == (0, 100_000_000)
        (body,), (arrow,), (text,) = r1.cubes, r1.arrows, r1.texts
        for pose in (body.pose, arrow.pose):
            assert place(pose) == pytest.approx((0.6 * t, 0.0))
            assert heading(pose) == pytest.approx(0.25 * t)
        assert place(text.pose) == place(body.pose)
        assert text.text == "r1"
        assert place(drawn["robot r2"].cubes[0].pose) == (0.0, -1.0)


def test_wheels_stand_at_both_ends_of_the_axle_and_roll_ahead(found) -> None:
    for t_ns, update in found["scene/robots"]:
        theta = 0.25 * t_ns * 1e-9
        r1 = entities(update)["robot r1"]
        x, y = place(r1.cubes[0].pose)
        for wheel, side in zip(r1.cylinders, (-1.0, 1.0), strict=True):  # right, left
            at = (x - side * 0.2 * sin(theta), y + side * 0.2 * cos(theta))
            assert place(wheel.pose) == pytest.approx(at)
            assert wheel.pose.position.z == wheel.size.x / 2 == 0.05
            q = wheel.pose.orientation
            # The axis of a cylinder, z, turned by q: along the axle, horizontal.
            axis = (2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x))
            assert axis == pytest.approx((sin(theta), -cos(theta)))
            assert 1 - 2 * (q.x**2 + q.y**2) == pytest.approx(0.0)


def test_references_are_drawn_where_controllers_have_them(found) -> None:
    for t_ns, update in found["scene/references"]:
        drawn = entities(update)
        for robot, behind in (("r1", 0.0), ("r2", 0.5)):
            (arrow,), (ball,) = (
                drawn[f"reference {robot}"].arrows,
                drawn[f"reference {robot}"].spheres,
            )
            assert place(arrow.pose) == pytest.approx((0.6e-9 * t_ns - behind, 7.0))
            assert place(ball.pose) == place(arrow.pose)
            assert heading(arrow.pose) == pytest.approx(0.1)


def test_frames_of_robots_are_where_robots_are(found) -> None:
    for (t_ns, said), (_, update) in zip(found["tf"], found["scene/robots"], strict=True):
        assert [it.child_frame_id for it in said.transforms] == list(ROBOTS)
        for frame in said.transforms:
            pose = entities(update)[f"robot {frame.child_frame_id}"].cubes[0].pose
            assert frame.parent_frame_id == "world"
            assert frame.timestamp.sec * 10**9 + frame.timestamp.nanosec == t_ns
            assert (frame.translation.x, frame.translation.y) == place(pose)
            assert (frame.rotation.z, frame.rotation.w) == (pose.orientation.z, pose.orientation.w)


def test_a_known_path_is_drawn_once_and_for_good(found) -> None:
    (path,) = found["scene/paths"][0][1].entities
    assert path.id == "path r1"
    assert (path.lifetime.sec, path.lifetime.nanosec) == (0, 0)
    (line,) = path.lines
    radius = [np.hypot(point.x - 1.0, point.y) for point in line.points]
    assert radius == pytest.approx([2.0] * len(line.points))
    ends = line.points[0], line.points[-1]  # a whole circle
    assert (ends[0].x, ends[0].y) == pytest.approx((ends[1].x, ends[1].y))


def strokes(line: Any) -> list[float]:
    """Lengths of the strokes of an edge."""
    ends = np.array([(point.x, point.y) for point in line.points]).reshape(-1, 2, 2)
    return np.hypot(*(ends[:, 1] - ends[:, 0]).T).tolist()


def test_an_edge_goes_from_the_robot_that_is_heard_to_the_one_that_hears(found) -> None:
    t_ns, update = found["scene/edges"][20]
    assert t_ns == 10**9
    edge = entities(update)["edge r1 -> r2"]
    (line,), (head,) = edge.lines, edge.arrows
    # From (0.6, 0) to (0, −1), 4 cm to the right of it.
    length = np.hypot(0.6, 1.0)
    side = 0.04 * np.array([-1.0, 0.6]) / length
    first, last = line.points[0], line.points[-1]
    assert (first.x, first.y) == pytest.approx((0.6 + side[0], side[1]))
    assert (last.x, last.y) == pytest.approx((side[0], side[1] - 1.0))
    assert sum(strokes(line)) == pytest.approx(length)
    assert place(head.pose) == pytest.approx((0.6 - 0.65 * 0.6 + side[0], side[1] - 0.65))
    assert heading(head.pose) == pytest.approx(np.arctan2(-1.0, -0.6))


def test_an_edge_shows_how_old_what_is_heard_over_it_is_and_whether_it_exists(found) -> None:
    for t_ns, update in found["scene/edges"]:
        drawn = entities(update)
        # Its age is 0.5 s of the 2 s that count: half of the way by the root.
        aged, news = drawn["edge r1 -> r2"].lines[0], drawn["edge r2 -> r1"].lines[0]
        assert (aged.color.r, aged.color.b) == pytest.approx((0.451, 0.349))
        assert aged.color.a == 0.9
        # Of r1 no ages are recorded; its edge goes at tick 100 and is back from tick 600 on.
        if 100 <= t_ns // PERIOD_NS < 600:
            assert news.color.a == drawn["edge r2 -> r1"].arrows[0].color.a == 0.0
            assert set(strokes(news)) == {0.0}
        else:
            assert (news.color.r, news.color.b, news.color.a) == (0.0, 0.698, 0.9)


@pytest.mark.parametrize("age", [nan, 2.5])
def test_an_edge_over_which_nothing_is_heard_is_grey_strokes(tmp_path: Path, age: float) -> None:
    rows = all_rows()
    rows["r2", "controller"][:, column(AGED, "age_of_r1_s")] = age
    for t_ns, update in messages(tmp_path / "a.mcap", rows)["scene/edges"]:
        line = entities(update)["edge r1 -> r2"].lines[0]
        assert line.color.r == line.color.g == line.color.b
        length = np.hypot(0.6e-9 * t_ns, 1.0)
        assert strokes(line) == pytest.approx([length / 16] * 8)  # and gaps as long


def test_a_robot_without_rows_of_a_plant_is_drawn_where_its_controller_takes_it_to_be(
    tmp_path: Path,
) -> None:
    rows = all_rows()
    del rows["r2", "plant"]
    rows["r2", "controller"][:, column(AGED, "x_used_m")] = 3.0
    said = messages(tmp_path / "a.mcap", rows)
    assert len(said["scene/robots"]) == MESSAGES
    for _, update in said["scene/robots"]:
        assert place(entities(update)["robot r2"].cubes[0].pose) == (3.0, 0.0)


def test_what_has_no_rows_any_more_is_drawn_no_more(tmp_path: Path) -> None:
    rows = all_rows()
    for source in ("plant", "controller"):
        rows["r2", source] = rows["r2", source][:530]
    said = messages(tmp_path / "a.mcap", rows)
    for topic in ("scene/robots", "scene/references"):
        for t_ns, update in said[topic]:
            assert len(update.entities) == (2 if t_ns < 530 * PERIOD_NS else 1)
    # No edge has both its robots from then on.
    assert said["scene/edges"][-1][0] == 525 * PERIOD_NS


def test_ticks_of_which_only_the_time_is_known_are_not_drawn(tmp_path: Path) -> None:
    rows = all_rows()
    for source in ("plant", "controller"):
        rows["r1", source][40:80, 1:] = nan
        rows["r2", source][60:, 1:] = nan
    said = messages(tmp_path / "a.mcap", rows)
    drawn = {t_ns // PERIOD_NS: list(entities(it)) for t_ns, it in said["scene/robots"]}
    assert drawn[25] == ["robot r1", "robot r2"]
    assert drawn[50] == ["robot r2"]
    assert 75 not in drawn
    assert drawn[100] == drawn[1075] == ["robot r1"]


def test_differences_of_path_variables_are_from_their_mean(found) -> None:
    for t_ns, said in found["fleet"]:
        assert said.tick == t_ns // PERIOD_NS
        assert said.s_spread == pytest.approx(0.5)
        assert list(said.s_difference) == pytest.approx([0.25, -0.25])


def test_a_robot_that_has_no_path_variable_yet_is_not_part_of_the_differences(
    tmp_path: Path,
) -> None:
    rows = all_rows()
    rows["r2", "controller"][:, column(AGED, "s")] = nan
    _, said = messages(tmp_path / "a.mcap", rows)["fleet"][3]
    assert (said.s_spread, said.s_difference[0]) == (0.0, 0.0)
    assert np.isnan(said.s_difference[1])


@pytest.mark.parametrize("ticks", [512, 1024, 1536])
def test_a_killed_recorder_leaves_out_views_of_the_last_instants_of_its_rows_alone(
    tmp_path: Path, ticks: int
) -> None:
    with RecordWriter(tmp_path / "a.mcap", TABLES, "", PERIOD_NS, drawing=DRAWING) as writer:
        for robot in ROBOTS:
            writer.add(robot, "plant", 0, plant(robot, ticks).tobytes())
            writer.add(robot, "controller", 0, controller(robot, ticks).tobytes())
        (tmp_path / "killed.mcap").write_bytes((tmp_path / "a.mcap").read_bytes())
    finish_truncated(tmp_path / "killed.mcap")
    whole, killed = read(tmp_path / "a.mcap"), read(tmp_path / "killed.mcap")
    for topic, said in whole.items():
        kept = killed.get(topic, [])
        assert [t_ns for t_ns, _ in kept] == [t_ns for t_ns, _ in said][: len(kept)]
        if topic.startswith("robot/"):
            assert len(kept) == len(said)
        else:
            assert len(said) - len(kept) < VIEW_INSTANTS
