"""Ages, margins and biases of an emulated network, against formulas and the channels themselves."""

from math import inf

import numpy as np
import pytest

from bridge.netem.channel import Channel
from configs.graph import Graph, generated
from configs.loading import load
from configs.netem import (
    BernoulliLoss,
    ConstantDelay,
    Effects,
    GilbertElliottLoss,
    TraceDelay,
    UniformDelay,
)
from fleetloop.check.emulated import emulated_forecast
from fleetloop.check.examine import examine
from fleetloop.check.finding import Finding
from fleetloop.check.network import data_delay_margin_s, hold_bias, mean_age_s
from fleetloop.check.rehearsal import rehearsal

MS = 1_000_000
BURSTS = GilbertElliottLoss(
    kind="gilbert_elliott", good_to_bad=0.1, bad_to_good=0.25, loss_in_bad=0.9, loss_in_good=0.05
)


def found(name: str, title: str, *overrides: str) -> list[Finding]:
    everything = examine(name, load(name, overrides), overrides)
    return [finding for finding in everything if finding.title.startswith(title)]


def measured_s(effects: Effects, period_s: float, shares: int = 20_000) -> float:
    """Mean age of the newest message, looked at ten times a period."""
    channel: Channel[None] = Channel(effects, "x", 0)
    newest, ages = 0, []
    every_ns = round(period_s * 1e8)
    for n in range(10 * shares):
        now_ns = n * every_ns
        if n % 10 == 0:
            channel.send(now_ns, None)
        newest = max([newest, *(sent_ns for sent_ns, _ in channel.receive(now_ns))])
        ages.append(now_ns + 0.5 * every_ns - newest)  # held for a tenth
    return float(np.mean(ages[len(ages) // 10 :])) * 1e-9


@pytest.mark.parametrize(
    "effects",
    [
        Effects(),
        Effects(delay=ConstantDelay(kind="constant", delay_s=0.3)),
        Effects(loss=BernoulliLoss(kind="bernoulli", probability=0.5)),
        Effects(delay=ConstantDelay(kind="constant", delay_s=0.1), loss=BURSTS),
        Effects(delay=UniformDelay(kind="uniform", min_s=0.1, max_s=0.2), reordering=False),
        Effects(delay=TraceDelay(kind="trace", delays_s=(0.02, -1.0, 0.02))),
        Effects(bandwidth_bit_s=20_480.0, message_bytes=128),  # 50 ms each
        Effects(bandwidth_bit_s=8_192.0, message_bytes=128, queue_messages=4),  # 125 ms: overflows
    ],
)
def test_the_mean_age_is_what_channels_measure(effects: Effects) -> None:
    assert mean_age_s(effects, 0.1) == pytest.approx(measured_s(effects, 0.1), rel=0.12)


def test_a_link_that_loses_everything_has_no_age() -> None:
    assert mean_age_s(Effects(loss=BernoulliLoss(kind="bernoulli", probability=1.0)), 0.1) == inf


@pytest.mark.parametrize(
    ("kind", "robots", "margin_s"),
    [("chain", 4, 2.74), ("ring", 4, 0.69), ("complete", 5, 0.45), ("complete", 11, 0.19)],
)
def test_the_margin_of_equal_ages_is_that_of_the_spectrum(
    kind: str, robots: int, margin_s: float
) -> None:
    names = [f"r{n}" for n in range(robots)]
    graph = Graph.of(names, generated(kind, names), names[:1])
    assert data_delay_margin_s(graph, 2.0, 1.0) == pytest.approx(margin_s, abs=0.01)


def test_held_values_leave_a_chain_apart_and_a_ring_slow() -> None:
    names = [f"r{n}" for n in range(4)]
    chain = Graph.of(names, generated("chain", names), names[:1])
    found = hold_bias(chain, dict.fromkeys(chain.edges, 0.12), 2.0, 1.0, 0.6)
    assert found is not None
    assert (found.speed_m_s, found.spread_m) == pytest.approx((0.0, 0.216))
    ring = Graph.of(names, generated("ring", names), names[:1])
    found = hold_bias(ring, dict.fromkeys(ring.edges, 0.525), 2.0, 1.0, 0.6)
    assert found is not None
    assert (found.speed_m_s, found.spread_m) == pytest.approx((-0.125, 0.0), abs=1e-3)


def test_hold_is_warned_of_with_the_spread_that_it_leaves() -> None:
    (bias,) = found("lossy_chain", "bias", "coordination.compensation='hold'")
    assert (bias.level, bias.key) == ("warning", "coordination.compensation")
    assert bias.value.startswith("spread 1.26 m")
    (spread,) = found("lossy_chain", "max s_i", "coordination.compensation='hold'")
    assert "still 1.2" in spread.value
    assert not found("lossy_chain", "bias")


def test_delay_margins_are_told_against_the_mean_age() -> None:
    both = "coordination.compensation='both'"
    (near,) = found("delay_ring", "delay margin", both)
    assert (near.level, near.value) == ("ok", "0.689 s")
    beyond = "network.default.delay.delay_s=0.9"
    (margin,) = found("delay_ring", "delay margin", both, beyond)
    assert margin.level == "error"
    assert found("delay_ring", "delay margin", beyond)[0].level == "ok"


def test_an_edge_that_carries_nothing_in_time_is_no_edge() -> None:
    late = "network.default.delay.delay_s=2.5"
    (rooted,) = found("delay_ring", "robots' graph is rooted, by what arrives", late)
    assert rooted.level == "error"
    assert "r1 -> r2" in rooted.value
    deaf = "network.edge=[{edges=['leader -> r1'], loss={kind='bernoulli', probability=1.0}}]"
    (reached,) = found("paper", "leader reaches every robot, by what arrives", deaf)
    assert reached.level == "error"


def test_the_forecast_over_a_network_is_the_run() -> None:
    scenario = load("lossy_chain", ("duration_s=12.0", "expect=[]", "robot.r1.s_0=0.4"))
    rows = rehearsal(scenario, 12.0).rows
    ahead = emulated_forecast(scenario, lambda _: pytest.fail("no loss by distance"))
    for n, name in enumerate(scenario.names):
        t_s = scenario.clock.control_period_s * np.arange(len(rows[name]))
        ours = np.interp(t_s, ahead.t_s, ahead.s[:, n])
        assert np.abs(ours - rows[name]["s"]).max() < 0.02


def test_nothing_is_known_over_an_edge_that_does_not_exist() -> None:
    late = 'network={default={delay={kind="constant", delay_s=0.2}}}'
    scenario = load("switching", ("duration_s=10.0", "expect=[]", late))
    ahead = emulated_forecast(scenario, lambda _: pytest.fail("no loss by distance"))
    ticks = np.round(ahead.t_s / scenario.clock.control_period_s).astype(int).tolist()
    for edge, ages in zip(ahead.edges, ahead.age_s.T, strict=True):
        (there,) = (one for one in scenario.topology.hears[edge[1]] if one.speaker == edge[0])
        exists = np.array([there.exists(tick) for tick in ticks])
        heard = np.isfinite(ages)
        assert heard.any()
        assert not (heard & ~exists).any()
