"""When a controller declares its subscriptions to in-neighbours, and when it undeclares them."""

from dataclasses import replace
from math import nan

import pytest
from support.robot_bench import NOWHERE, SCENARIO

from agents.subscriptions import LEAVES, RETURNS, Subscriptions
from bridge.network import keys
from configs.brief import AgentBrief, ChannelModel
from configs.edges import FOREVER, InEdge
from configs.netem import DistanceLoss
from configs.resolve import agent_brief

HEARS = (
    InEdge("r1"),
    InEdge("r3", 1.0, ((0, 10), (20, 30))),
    InEdge("r4", 1.0, ((5, FOREVER),)),
)


class Recording:
    """A link that keeps what is subscribed to."""

    def __init__(self) -> None:
        self.keys: set[str] = set()

    def subscribe(self, key: str, tag: str) -> None:
        assert key not in self.keys
        assert tag == f"path/{key.split('/')[-2]}"
        self.keys.add(key)

    def unsubscribe(self, key: str) -> None:
        self.keys.remove(key)


def declared(*, realtime: bool) -> list[str]:
    """The speakers that are subscribed to at each of 40 ticks."""
    brief: AgentBrief = agent_brief(SCENARIO, "r2", network=NOWHERE, bus=())
    brief = replace(brief, hears=HEARS, schedule=replace(brief.schedule, realtime=realtime))
    link = Recording()
    subscriptions = Subscriptions(link, brief)
    at = []
    for tick in range(-5, 40):
        if realtime:
            subscriptions.follow(tick, {})
        elif tick >= subscriptions.next_change:
            subscriptions.change(tick)
        if tick >= 0:
            there = [r for r in ("r1", "r3", "r4") if keys.path("test", r) in link.keys]
            at.append(" ".join(there))
    return at


@pytest.mark.parametrize("realtime", [True, False])
def test_a_subscription_lasts_as_long_as_its_edge_or_in_lockstep_its_last_window(
    realtime: bool,
) -> None:
    if realtime:
        expected = [*["r1 r3"] * 5, *["r1 r3 r4"] * 5, *["r1 r4"] * 10, *["r1 r3 r4"] * 10]
    else:
        expected = ["r1 r3 r4"] * 30
    assert declared(realtime=realtime) == [*expected, *["r1 r4"] * 10]


def following(*ways: tuple[int, float], realtime: bool = True) -> list[str]:
    """The speakers that are subscribed to, r1 with a range of 5 m, after each (tick, distance)."""
    near = ChannelModel(source="r1", seed="", distance=DistanceLoss(range_m=5.0))
    brief: AgentBrief = agent_brief(SCENARIO, "r2", network=NOWHERE, bus=())
    schedule = replace(brief.schedule, realtime=realtime)
    brief = replace(brief, hears=HEARS, channels=(near,), schedule=schedule)
    link = Recording()
    subscriptions = Subscriptions(link, brief)
    at = []
    for tick, distance_m in ways:
        subscriptions.follow(tick, {"r1": distance_m})
        at.append(" ".join(sorted(key.split("/")[-2] for key in link.keys)))
    return at


def test_out_of_range_no_subscription_is_declared_and_it_is_again_before_the_range() -> None:
    leaves_m, returns_m = 5.0 * LEAVES, 5.0 * RETURNS
    assert 5.0 < returns_m < leaves_m
    ways = [(0, nan), (1, 0.99 * leaves_m), (2, leaves_m), (3, nan), (4, returns_m)]
    assert following(*ways, (6, 0.99 * returns_m), (7, 0.99 * leaves_m)) == [
        "r1 r3",
        "r1 r3",
        "r3",
        "r3",
        "r3",
        "r1 r3 r4",
        "r1 r3 r4",
    ]


def test_out_of_range_an_edge_that_comes_and_goes_stays_undeclared() -> None:
    assert following((0, 9.0), (12, 9.0), (22, 9.0), (31, 1.0)) == ["r3", "r4", "r3 r4", "r1 r4"]


def test_in_lockstep_a_range_changes_no_subscription() -> None:
    assert following((0, 9.0), realtime=False) == ["r1 r3 r4"]
