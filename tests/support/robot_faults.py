"""What stops one robot of the bench, and what ends it."""

from support.robot_bench import Bench

from agents.guard import Phase
from bridge.drives.odrive.frames import Command as Cmd

REARM = ("host.rearm=true",)


def failing(bench: Bench, within: int = 300) -> list[list]:
    """What is sent from a fault on until the robot has stopped."""
    return bench.until(Phase.STOPPED, within)


def by_estop(bench: Bench) -> None:
    bench.estop(0)


def by_estop_on_the_bus(bench: Bench) -> None:
    bench.estop(1, heard=True)


def by_reboot(bench: Bench) -> None:
    bench.reboot(1)


def by_silence(bench: Bench) -> None:
    bench.silent = {0}


def by_lost_heartbeats(bench: Bench) -> None:
    bench.mute = {(0, Cmd.HEARTBEAT)}


def by_lost_encoder_frames(bench: Bench) -> None:
    bench.mute = {(1, Cmd.GET_ENCODER_ESTIMATES)}


def by_lost_pose(bench: Bench) -> None:
    bench.pose = None


def by_bus_error(bench: Bench) -> None:
    bench.agent.guard.bus_fault = "bus error: network is down"


def mend(bench: Bench) -> None:
    """Everything is back that can come back by itself."""
    bench.silent, bench.mute, bench.pose = set(), set(), (1.95, 0.05, 1.57)
    bench.agent.guard.bus_fault = None
