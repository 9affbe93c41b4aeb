"""Buses in real time: what drives say between two ticks."""

from collections.abc import Sequence

from bridge.drives.odrive.frames import Command
from bridge.frame import Frame
from bridge.telemetry import no_tap
from configs.brief import NetworkLink
from configs.loading import load
from configs.resolve import plant_brief
from plant.bus.live import IdealLive
from plant.robot import unit_of

MS = 1_000_000


class End:
    """The drives' end of a bus on which nobody says anything."""

    def __init__(self) -> None:
        self.said: list[tuple[int, Frame]] = []

    def deliver(self, _: str, stamp_ns: int, frames: Sequence[Frame]) -> None:
        self.said += [(stamp_ns, frame) for frame in frames]

    def take(self, _: str) -> list[Frame]:
        return []


def encoder_stamps(*overrides: str) -> list[int]:
    """When node 0 said its encoder frames within 20 ms, ticks every 10 ms, looked at every 0.5."""
    scenario = load("two_robots_100hz", overrides)
    brief = plant_brief(scenario, network=NetworkLink("t", "", "", ""))
    end = End()
    live = IdealLive("r1", [unit_of(brief.robots[0])], end, 0, MS, no_tap)
    often = brief.robots[0].drive.encoder_period_ns < brief.schedule.period_ns
    for now_ns in range(0, 20 * MS, MS // 2):
        if now_ns % brief.schedule.period_ns == 0:
            live.tick(now_ns)
            live.speak(now_ns)
        elif often and live.next_ns() <= now_ns:
            live.advance(now_ns)
    return [
        at_ns for at_ns, frame in end.said if frame.can_id == Command.GET_ENCODER_ESTIMATES.value
    ]


def test_encoder_frames_come_with_the_ticks_unless_they_have_a_period_of_their_own() -> None:
    assert encoder_stamps() == [0, 10 * MS]
    assert encoder_stamps("drive.encoder_period_s=0.002") == [k * MS for k in range(0, 20, 2)]
