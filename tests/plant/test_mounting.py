"""Mirrored drives and gears: what the host converts, the emulated robot converts back."""

import pytest

from bridge.drives import protocol
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import Command, identifier
from bridge.frame import Frame
from configs.connections import NetworkLink
from configs.loading import load
from configs.resolve import agent_brief, plant_brief
from plant.robot import EmulatedRobot, emulated_robot

NETWORK = NetworkLink("t", "", "", "")
CLOSE = [Frame(identifier(node, Command.SET_AXIS_STATE), f.ONE_U32.pack(8)) for node in (0, 1)]
MIRRORED = "mounting.left_sign=-1"


def driven(*overrides: str) -> tuple[tuple[float, ...], tuple[float, ...], EmulatedRobot]:
    """What the host reads, what is recorded, and the robot, after 0.1 s of torque."""
    scenario = load("two_robots", overrides)
    robot = emulated_robot(plant_brief(scenario, network=NETWORK).robots[0])
    link = agent_brief(scenario, "r1", network=NETWORK, bus=()).drives
    client = protocol(link.choice.plugin).client(link)
    for frame in (*client.torque(0.2, 0.1), *CLOSE):
        robot.on_frame(frame, 0)
    for k in range(50):
        robot.advance(k * 0.002, 0.002, 2)
    for frame in robot.frames_due(100_000_000):
        client.on_frame(frame.can_id, frame.data, 100_000_000)
    motion = client.motion()
    assert motion is not None
    return motion, robot.row(0.1), robot


@pytest.mark.parametrize(
    ("overrides", "shafts"),
    [
        ((MIRRORED,), (0.2, -0.1)),
        (("mounting.right_sign=-1",), (-0.2, 0.1)),
        (("mounting.gear_ratio=4.0",), (0.05, 0.025)),
        ((MIRRORED, "mounting.gear_ratio=0.5"), (0.4, -0.2)),
    ],
)
def test_a_mounting_changes_the_shafts_and_nothing_at_the_wheels(overrides, shafts) -> None:
    plain, plain_row, _ = driven()
    motion, row, robot = driven(*overrides)
    assert motion == pytest.approx(plain, rel=1e-6)
    assert row == pytest.approx(plain_row, rel=1e-6)
    assert [drive.input_torque_shaft for drive in robot.drives] == pytest.approx(shafts)


def test_a_real_motor_that_is_mirrored_drives_its_wheel_forward_too() -> None:
    realistic = "drive.preset='realistic'"
    (plain, _, _), (mirrored, _, _) = driven(realistic), driven(realistic, MIRRORED)
    assert mirrored == pytest.approx(plain, rel=0.05)


def test_a_real_motor_behind_a_gear_is_quicker_than_its_wheel() -> None:
    motion, row, robot = driven("drive.preset='realistic'", "mounting.gear_ratio=2.0")
    _, _, _, _, v, _, *_ = row
    assert sum(motion[2:]) / 2 * 0.04 == pytest.approx(v, rel=0.05)
    turns = f.TWO_FLOATS.unpack(robot.drives[0].feedback(200_000_000).data)[1]
    assert turns == pytest.approx(2.0 * motion[2] / 6.283185307179586, rel=0.05)
