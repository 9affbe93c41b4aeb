"""The plant by the wall clock: what it says of itself."""

from types import SimpleNamespace

from support.clocks import ManualClock
from support.in_process import NETWORK

from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub
from bridge.network.messages import Progress
from bridge.network.telemetry import PLANT_ROW, RowBuffer
from bridge.process.lifecycle import Stop
from configs.loading import load
from configs.resolve import plant_brief
from plant.realtime import RealtimeLoop
from plant.robot import emulated_robot


def test_progress_ends_at_the_closing_tick(runtime_folder) -> None:
    brief = plant_brief(load("two_robots_100hz", ("until_s=0.1",)), network=NETWORK)
    hub = Hub(sockets.listen(sockets.create_run_folder("run"), ("r1", "r2")))
    robots = [emulated_robot(robot) for robot in brief.robots]
    rows = [RowBuffer(PLANT_ROW, lambda *_: None) for _ in robots]
    poses = [SimpleNamespace(put=lambda _: None) for _ in robots]
    clock = ManualClock(10**12)  # all ticks are overdue
    said: list[int] = []

    def report(progress: Progress) -> None:
        said.append(progress.tick)
        clock.passes(1.0)  # so that it is asked for after every tick

    loop = RealtimeLoop(brief, robots, hub, hub, poses, rows, report, {}, clock=clock)
    loop.run(0, Stop())
    hub.close("end of the test")
    ticks = brief.schedule.ticks
    assert said[-3:] == [ticks - 1, ticks, ticks]
    assert loop.progress().tick == ticks
