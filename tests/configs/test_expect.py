"""Expectations as sentences, their windows, and what is refused with what would be right."""

import pytest

from configs.errors import ScenarioError
from configs.expect import Expect, Window, claim, window_of
from configs.loading import load

FAULTS = """fault=[
  {name="push", kind="push", at_s=1.0, for_s=0.5, robots=["r1"], force_body_N=8.0},
  {name="cut", kind="link_partition", at_s=3.0, edges=["r1 -> r2"]}]"""


def refused(expect: str, *overrides: str) -> str:
    with pytest.raises(ScenarioError) as error:
        load("two_robots", (*overrides, f"expect=[{{{expect}}}]"))
    return str(error.value)


@pytest.mark.parametrize(
    ("expect", "says"),
    [
        ({"signal": "y_e_m", "max_abs": 0.01}, "y_e_m within ±0.01 from 0 s"),
        (
            {"signal": "s", "robots": ("r1", "r2"), "min": 1.0, "max": 2.0, "to_s": 3.0},
            "s of r1, r2 within 1 to 2 from 0 s to 3 s",
        ),
        (
            {"signal": "x_e_m", "max_abs": 0.1, "settle_within_s": 2.0, "after_end": "push"},
            "x_e_m settles within ±0.1 in 2 s after the end of push",
        ),
        (
            {"signal": "mu", "max": 1.0, "quantile": 0.99, "during": "push"},
            "mu within 1 or less at 99 % of the ticks during push",
        ),
        (
            {"signal": "robot_distance_m", "max": 0.3, "holds": "never", "for_s": 0.5},
            "robot_distance_m never within 0.3 or less for 0.5 s from 0 s",
        ),
        (
            {"signal": "s", "min": 5.0, "holds": "eventually", "before": "push"},
            "s eventually within 5 or more before push",
        ),
        ({"event": "stopped", "at_most": 0}, "event stopped never from 0 s"),
        ({"event": "stopped", "at_most": 2}, "event stopped at most 2 times from 0 s"),
        ({"event": "stopped", "at_least": 1, "at_most": 1}, "event stopped once from 0 s"),
        ({"event": "stopped", "at_least": 0, "at_most": 1}, "event stopped 0 to 1 times from 0 s"),
        (
            {"event": "rearmed", "at_least": 1, "robots": ("r2",), "after": "push", "to_s": 2.0},
            "event rearmed of r2 at least once to 2 s after push",
        ),
    ],
)
def test_an_expectation_reads_as_a_sentence(expect: dict[str, object], says: str) -> None:
    assert claim(Expect(**expect)) == says


@pytest.mark.parametrize(
    ("when", "window"),
    [
        ({}, (0, 1999)),
        ({"from_s": 0.5}, (250, 1999)),
        ({"from_s": 0.5, "to_s": 1.0}, (250, 500)),
        ({"to_s": 4.0}, (0, 1999)),
        ({"before": "push"}, (0, 499)),
        ({"from_s": 0.5, "before": "push"}, (250, 499)),
        ({"during": "push"}, (500, 749)),
        ({"during": "push", "from_s": 0.1}, (550, 749)),
        ({"during": "push", "from_s": 0.1, "to_s": 0.2}, (550, 600)),
        ({"after": "push"}, (500, 1999)),
        ({"after": "push", "from_s": 1.0, "to_s": 2.0}, (1000, 1500)),
        ({"after_end": "push"}, (750, 1999)),
        ({"after_end": "push", "to_s": 0.1}, (750, 800)),
        ({"during": "cut"}, (1500, 1999)),
    ],
)
def test_a_window_is_of_whole_ticks_and_what_is_relative_to_a_fault_moves_with_it(
    when: dict[str, object], window: tuple[int, int]
) -> None:
    scenario = load("two_robots", (FAULTS,))
    expect = Expect(signal="s", max=1.0, **when)
    assert window_of(expect, scenario, 4.0) == Window(*window)


@pytest.mark.parametrize(
    ("expect", "key", "remedy"),
    [
        ("max=1.0", "signal", "must be given, or event instead"),
        ("signal='s', event='stopped', max=1.0", "event", "one of both"),
        ("signal='s', max=1.0, at_most=0", "at_most", "of a signal max_abs, min or max"),
        ("signal='s', max=1.0, for_s=1.0", "for_s", 'holds = "eventually"'),
        ("signal='s', max=1.0, holds='never', quantile=0.9", "quantile", "never may have for_s"),
        (
            "signal='s', max=1.0, holds='eventually', settle_within_s=0.9",
            "settle_within_s",
            "leave out one of both",
        ),
        ("signal='s', max=1.0, quantile=0.9, settle_within_s=0.9", "quantile", "once settled"),
        ("signal='s', max=1.0, quantile=1.0", "quantile", "less than 1"),
        ("signal='s', max=1.0, holds='sometimes'", "holds", "'eventually'"),
        ("signal='s', max=1.0, holds='never', for_s=9.0", "for_s", "longer than the window, 3.998"),
        ("signal='s', max=1.0, settle_within_s=2.0, from_s=3.0", "settle_within_s", "0.998 s"),
        ("signal='robot_distance_m', min=0.1, robots=['r1']", "robots", "two or more"),
        ("signal='robot_distance', min=0.1", "signal", "did you mean robot_distance_m?"),
        ("signal='t_s', min=0.1", "signal", "no such signal"),
        ("event='rearm', at_least=1", "event", "did you mean rearmed?"),
        ("event='rearmed'", "", "at_most = 0 says never"),
        ("event='rearmed', at_least=0", "at_least", "holds anyway"),
        ("event='rearmed', at_least=3, at_most=2", "at_least", "at most at_most = 2"),
        ("event='rearmed', holds='never'", "holds", "of an event say at_most = 0"),
        ("event='rearmed', holds='eventually'", "holds", "of an event say at_least = 1"),
        ("event='rearmed', at_least=1, max=3.0", "max", "events are counted"),
        ("event='rearmed', at_least=1, robots=['r7']", "robots", "known: r1, r2"),
        ("signal='s', max=1.0, after='push', before='cut'", "after", "leave out"),
        ("signal='s', max=1.0, after='pus'", "after", "did you mean push? (known: push, cut)"),
        ("signal='s', max=1.0, after_end='cut'", "after_end", "give it for_s, or after"),
        ("signal='s', max=1.0, before='push', to_s=0.5", "to_s", "leave it out"),
        ("signal='s', max=1.0, before='push', from_s=1.0", "from_s", "no tick from there"),
        ("signal='s', max=1.0, during='push', from_s=0.6", "from_s", "no tick from there"),
        ("signal='s', max=1.0, after='push', from_s=3.0", "from_s", "counted from 1 s"),
        ("signal='s', max=1.0, after='push', to_s=3.5", "to_s", "counted from 1 s"),
    ],
)
def test_what_does_not_belong_together_is_refused_with_what_does(
    expect: str, key: str, remedy: str
) -> None:
    said = refused(expect, FAULTS)
    assert f"expect.0{'.' if key else ''}{key} = " in said, said
    assert remedy in said, said
    assert said.count("\n") <= 1, said


def test_a_scenario_without_faults_says_so() -> None:
    assert "the scenario has no [[fault]]" in refused("signal='s', max=1.0, after='push'")


def test_nothing_is_during_an_instant() -> None:
    jump = "fault=[{name='jump', kind='localisation_jump', at_s=2.0, robots=['r1'], x_m=0.1}]"
    assert "after instead of during" in refused("signal='s', max=9.0, during='jump'", jump)
