"""The part of each shipped law in the sampled loop near the path."""

from dataclasses import replace
from math import inf

import pytest

from agents.laws.interface import PathVariable, Reference, RobotMotion, Theta
from configs.loading import load
from configs.sections import LAW
from fleetloop.check.loop import Loop, channel_radius, elements, pole_time_s, true_theta
from fleetloop.check.sampling import loop_of

BASELINES = ("fixed_dsc", "backstepping_analytic", "backstepping_numeric")
LAWS = ("adaptive_dsc", "adaptive_dsc_robust", *BASELINES)
ARCS = (1.0, 0.0, 0.6), (1.2, 0.4, 0.5), (0.8, -1.1, 0.7)


def loop(law: str, **gains: object) -> Loop:
    """The loop of the paper's first robot under a law."""
    paper = load("paper")
    choice = LAW.choose({"law": law, **gains}, "")
    made = loop_of(paper, paper.robot[0])
    return replace(made, law=choice.load(), gains=choice.parameters)


@pytest.mark.parametrize("arc", ARCS)
@pytest.mark.parametrize("law", LAWS)
def test_with_true_parameters_steady_motion_goes_on(law: str, arc: tuple[float, ...]) -> None:
    v_bar, omega_bar, s_dot = arc
    v, omega = v_bar * s_dot, omega_bar * s_dot
    one = loop(law)
    theta: Theta = true_theta(one.body)
    if law in BASELINES:
        one = replace(one, gains=replace(one.gains, theta=theta))
    element = elements(one, *arc)[-1]
    here = Reference(0.0, 0.0, 0.0, v_bar, omega_bar)
    motion, along = RobotMotion(0.0, 0.0, 0.0, v, omega), PathVariable(0.0, s_dot, 0.0)
    right, left, fast = element.step(element.steady, motion, here, along)
    needed = one.body.wheel_torques(v, omega, 0.0, 0.0)
    assert (right, left) == pytest.approx(needed, rel=1e-9, abs=1e-12)
    assert fast == pytest.approx(element.steady, abs=1e-12)


def test_what_adapts_has_two_elements_and_what_is_fixed_has_one() -> None:
    counts = [len(elements(loop(law), *ARCS[0])) for law in LAWS]
    assert counts == [2, 2, 1, 1, 1]


@pytest.mark.parametrize("arc", ARCS)
def test_the_fixed_law_is_the_adaptive_one_that_has_learnt(arc: tuple[float, ...]) -> None:
    learnt = replace(loop("adaptive_dsc"), learnt=True)
    fixed = loop("fixed_dsc", theta=true_theta(learnt.body))
    assert channel_radius(fixed, *arc) == channel_radius(learnt, *arc)


def test_the_laws_own_torque_limit_does_not_act_near_the_path() -> None:
    tight = loop("adaptive_dsc_robust", torque_limit_wheel_N_m=1e-6)
    free = loop("adaptive_dsc_robust", torque_limit_wheel_N_m=1e6)
    assert channel_radius(tight, *ARCS[1]) == channel_radius(free, *ARCS[1])


@pytest.mark.parametrize(
    ("gains", "slowest_1_s"),
    [({"k1": 1.0}, 1.0), ({"k3": 0.7}, 0.7), ({"k2": 0.5}, 0.5 * 0.6)],
)
def test_without_filters_errors_decay_with_the_gains_themselves(
    gains: dict[str, float], slowest_1_s: float
) -> None:
    # On a line x_e' = −k_1 x_e, (θ_e − θ̄)' = −k_3 (θ_e − θ̄), y_e' = −k_2 v y_e + ...
    one = loop("backstepping_analytic", **gains)
    radius = channel_radius(one, *ARCS[0])
    assert pole_time_s(radius, one.period_s) == pytest.approx(1.0 / slowest_1_s, rel=0.01)


def test_only_what_adapts_without_being_normalised_has_a_limit() -> None:
    limits = {}
    for law in LAWS:
        one = loop(law)
        limits[law] = one.law.adaptation_limit(one.gains, one.period_s)
        assert one.law.torque_limit_wheel_N_m(one.gains) in (inf, 2.0)
    assert [law for law, limit in limits.items() if limit is not None] == ["adaptive_dsc"]
