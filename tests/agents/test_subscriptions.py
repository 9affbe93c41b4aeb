"""When a controller declares its subscriptions to in-neighbours, and when it undeclares them."""

from dataclasses import replace

import pytest
from support.robot_bench import NOWHERE, SCENARIO

from agents.subscriptions import Subscriptions
from bridge.network import keys
from configs.brief import AgentBrief
from configs.edges import FOREVER, InEdge
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
        if tick >= subscriptions.next_change:
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
