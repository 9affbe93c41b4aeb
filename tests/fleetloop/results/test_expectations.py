"""Verdicts on synthetic records: worst tick and robots, margins, windows that weren't seen."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from configs.events import MAX_EVENTS, Event
from configs.expect import Expect
from configs.loading import load
from configs.resolve import signals_of
from configs.signals import PLANT_SIGNALS
from fleetloop.record.reader import Record
from fleetloop.results.expectations import Judged, judge, out_of_reach, verdict
from fleetloop.results.tables import finding

TICKS, PERIOD_S = 2000, 0.002
T = np.arange(TICKS) * PERIOD_S
CUT = "fault=[{name='cut', kind='link_partition', at_s=1.0, for_s=1.0, edges=['r1 -> r2']}]"
SCENARIO = load("two_robots", (CUT,))


def rows(signals: Any, **values: np.ndarray) -> np.ndarray:
    made = np.zeros(TICKS, np.dtype([("tick", "<i8"), *((it.name, "<f8") for it in signals)]))
    made["tick"], made["t_s"] = np.arange(TICKS), T
    for name, value in values.items():
        made[name] = value
    return made


def record(**values: dict[str, np.ndarray]) -> Record:
    """Of two robots, signals that aren't given are 0."""
    tables = {robot.name: tuple(signals_of(SCENARIO, robot)) for robot in SCENARIO.robot}
    plant_names = {signal.name for signal in PLANT_SIGNALS}
    plant, controller = {}, {}
    for robot, table in tables.items():
        own = values.get(robot, {})
        plant[robot] = rows(PLANT_SIGNALS, **{k: v for k, v in own.items() if k in plant_names})
        controller[robot] = rows(table, **{k: v for k, v in own.items() if k not in plant_names})
    return Record(Path("record.mcap"), tuple(tables), plant, controller, tables, "", "")


def cut(whole: Record, robot: str, ticks: int) -> Record:
    """The record without the last rows of a robot."""
    whole.plant[robot] = whole.plant[robot][:ticks]
    whole.controller[robot] = whole.controller[robot][:ticks]
    return whole


def judged(seen: Record, *events: Event, **expect: Any) -> Judged:
    return judge(Expect(**expect), seen, SCENARIO, events)


DECAY = record(r1={"y_e_m": np.exp(-T)}, r2={"y_e_m": -2.0 * np.exp(-T)})


def test_the_worst_tick_and_robot_and_the_margin_are_those_of_the_closed_form() -> None:
    found = judged(DECAY, signal="y_e_m", max_abs=0.1, from_s=2.5)
    assert found["held"] is False
    assert found["worst"] == {"robots": ["r2"], "tick": 1250, "t_s": 2.5}
    assert found["value"] == pytest.approx(-2.0 * np.exp(-2.5))
    assert found["bound"] == {"max_abs": 0.1}
    assert found["margin"] == pytest.approx(0.1 - 2.0 * np.exp(-2.5))
    assert found["unit"] == "m"
    assert finding(found) == "found -0.164 m (r2) at 2.5 s, margin -0.064 m"
    of_r1 = judged(DECAY, signal="y_e_m", max_abs=0.1, from_s=2.5, robots=("r1",))
    assert of_r1["held"] is True
    assert of_r1["margin"] == pytest.approx(0.1 - np.exp(-2.5))


def test_of_two_bounds_the_one_that_is_nearer_is_named() -> None:
    found = judged(DECAY, signal="y_e_m", robots=("r1",), min=-5.0, max=1.5)
    assert (found["bound"], found["margin"]) == ({"max": 1.5}, 0.5)


def test_robots_settle_by_themselves_and_the_slowest_counts() -> None:
    found = judged(DECAY, signal="y_e_m", max_abs=0.1, settle_within_s=2.5)
    assert found["held"] is False
    assert found["value"] == pytest.approx(np.log(20.0), abs=PERIOD_S)
    assert found["margin"] == pytest.approx(2.5 - np.log(20.0), abs=PERIOD_S)
    assert (found["unit"], found["bound"]) == ("s", {"settle_within_s": 2.5})
    after = judged(DECAY, signal="y_e_m", max_abs=0.1, settle_within_s=1.5, after_end="cut")
    assert after["window"] == {"from_s": 2.0, "to_s": 3.998}
    assert after["value"] == pytest.approx(np.log(20.0) - 2.0, abs=PERIOD_S)
    never = judged(DECAY, signal="y_e_m", max_abs=0.01, settle_within_s=2.5)
    assert (never["held"], never["value"]) == (False, None)
    assert finding(never) == "not settled (r1) at 3.998 s"


def test_a_quantile_is_of_each_robots_ticks() -> None:
    share = 1.0 - np.log(2.0) / 4.0  # of the window in which exp(−t) is below a half
    for robot, quantile, held in (
        ("r1", share - 0.01, True),
        ("r1", share + 0.01, False),
        ("r2", share - 0.01, False),
    ):
        found = judged(DECAY, signal="y_e_m", max_abs=0.5, quantile=quantile, robots=(robot,))
        assert found["held"] is held


def test_eventually_and_never_name_the_tick_that_comes_nearest() -> None:
    sine = record(r1={"mu": np.sin(2.0 * np.pi * T)}, r2={"mu": np.full(TICKS, 2.0)})
    high = judged(sine, signal="mu", min=0.9, holds="eventually", robots=("r1",))
    assert (high["held"], high["worst"]["t_s"]) == (True, 0.25)
    assert high["margin"] == pytest.approx(0.1)
    too_high = judged(sine, signal="mu", min=1.5, holds="never")
    assert (too_high["held"], too_high["worst"]["robots"]) == (False, ["r2"])
    # sin ≥ 0.5 from 1/12 s to 5/12 s: a third of a second in one piece.
    for for_s, held in ((0.32, True), (0.34, False)):
        piece = {"signal": "mu", "min": 0.5, "robots": ("r1",), "for_s": for_s}
        assert judged(sine, holds="eventually", **piece)["held"] is held
        assert judged(sine, holds="never", **piece)["held"] is not held


def test_a_distance_is_of_every_pair_and_a_spread_names_who_is_farthest_apart() -> None:
    apart = record(r1={"x_m": 3.0 - T, "s": T}, r2={"y_m": np.full(TICKS, 0.3), "s": 0.5 * T})
    near = judged(apart, signal="robot_distance_m", min=0.5)
    assert near["worst"] == {"robots": ["r1", "r2"], "tick": 1500, "t_s": 3.0}
    assert near["margin"] == pytest.approx(-0.2)
    spread = judged(apart, signal="s_spread", max=1.0)
    assert spread["worst"] == {"robots": ["r1", "r2"], "tick": 1999, "t_s": 3.998}
    assert spread["value"] == pytest.approx(1.999)


def test_what_is_no_number_fails_whatever_is_expected_of_it() -> None:
    broken = record(r1={"mu": np.where(T > 1.0, np.inf, 0.0)})
    for how in ({}, {"holds": "never"}, {"holds": "eventually"}, {"quantile": 0.1}):
        found = judged(broken, signal="mu", max=1.0, min=-1.0, **how)
        assert (found["held"], found["worst"]["robots"]) == (False, ["r1"])
        assert found["worst"]["t_s"] == pytest.approx(1.0, abs=2 * PERIOD_S)


def test_a_window_that_was_not_seen_to_its_end_is_decided_by_what_can_not_change() -> None:
    short = cut(record(r1={"mu": T}, r2={"mu": T}), "r2", 1000)
    for expect, held in (
        ({"max": 9.0}, None),
        ({"max": 1.0}, False),
        ({"min": 1.0, "holds": "eventually"}, True),
        ({"min": 3.0, "holds": "eventually"}, None),
        ({"max": 9.0, "robots": ("r1",)}, True),
        ({"max": 9.0, "to_s": 1.998}, True),
        ({"max": 9.0, "from_s": 2.0}, None),
        ({"max": 1.0, "quantile": 0.1, "robots": ("r2",)}, True),
        ({"max": -1.0, "quantile": 0.6, "robots": ("r2",)}, False),
        ({"max": 1.0, "quantile": 0.6, "robots": ("r2",)}, None),
    ):
        found = judged(short, signal="mu", **expect)
        assert found["held"] is held, expect
        assert ("seen_to_s" in found) == (held is None)
    assert judged(short, signal="mu", max=9.0)["seen_to_s"] == 1.998
    # A window that begins after the end of the run: what was seen of the run is told.
    for whole in (record(r1={"mu": T}, r2={"mu": T}), record(r1={"mu": T})):
        late = judged(whole, signal="mu", max=9.0, from_s=1e6)
        assert (late["held"], late["seen_to_s"]) == (None, pytest.approx(T[-1]))


EVENTS = (
    Event(-50, "r1", "armed"),
    Event(-50, "r2", "armed"),
    Event(600, "r2", "stopped", "no pose"),
    Event(1100, "r2", "rearmed"),
    Event(1500, "r2", "stopped", "no pose"),
)


@pytest.mark.parametrize(
    ("expect", "held", "count", "margin"),
    [
        ({"event": "stopped", "at_most": 0}, False, 2, -2),
        ({"event": "stopped", "at_most": 0, "robots": ("r1",)}, True, 0, 0),
        ({"event": "stopped", "at_most": 0, "robots": ("r1", "r2")}, False, 2, -2),
        ({"event": "stopped", "at_least": 1}, True, 2, 1),
        ({"event": "stopped", "at_least": 1, "robots": ("r1", "r2")}, False, 0, -1),
        ({"event": "stopped", "at_least": 1, "at_most": 1, "during": "cut"}, True, 1, 0),
        ({"event": "stopped", "at_most": 1, "after_end": "cut"}, True, 1, 0),
        ({"event": "rearmed", "at_least": 1, "after": "cut", "to_s": 1.2}, True, 1, 0),
        ({"event": "rearmed", "at_least": 1, "after": "cut", "to_s": 1.198}, False, 0, -1),
        ({"event": "armed", "at_least": 1, "robots": ("r1", "r2")}, True, 1, 0),
        ({"event": "armed", "at_most": 0, "from_s": 0.1}, True, 0, 0),
    ],
)
def test_events_are_counted_in_their_window_by_robot_or_all_together(
    expect: dict[str, Any], held: bool, count: int, margin: int
) -> None:
    found = judged(record(), *EVENTS, **expect)
    assert (found["held"], found["value"], found["margin"]) == (held, count, margin)


def test_more_events_than_allowed_name_the_first_and_its_tick() -> None:
    found = judged(record(), *EVENTS, event="stopped", at_most=0)
    assert found["worst"] == {"robots": ["r2"], "tick": 600, "t_s": 1.2}
    assert finding(found) == "found 2 (r2) at 1.2 s, margin -2"


def test_events_of_a_run_that_ended_early_may_still_come() -> None:
    short = cut(cut(record(), "r1", 1000), "r2", 1000)
    assert judged(short, *EVENTS, event="rearmed", at_most=0)["held"] is False
    assert judged(short, *EVENTS, event="diverged", at_most=0)["held"] is None
    assert judged(short, *EVENTS, event="diverged", at_least=1)["held"] is None
    assert judged(short, *EVENTS, event="stopped", at_least=1)["held"] is True


def test_what_is_not_known_of_events_is_not_reached() -> None:
    never = Expect(event="stopped", at_most=0)
    assert judge(never, record(), SCENARIO, None)["held"] is None
    many = [Event(tick, "r1", "rearming") for tick in range(MAX_EVENTS)]
    assert judge(never, record(), SCENARIO, many)["held"] is None
    assert judge(never, record(), SCENARIO, many[1:])["held"] is True
    early = Expect(event="stopped", at_most=0, to_s=0.5)
    assert judge(early, record(), SCENARIO, many)["held"] is True


def test_a_run_that_ends_before_a_window_says_which() -> None:
    late = "expect=[{signal='s', max=9.0, after='cut', to_s=1.5}, {signal='s', max=9.0}]"
    lines = out_of_reach(load("two_robots", (CUT, late, "until_s=2.0")))
    assert lines == ["not checked: s within 9 or less to 1.5 s after cut; the run ends at 2 s"]


def test_one_that_failed_outweighs_all_and_one_that_was_not_reached_those_that_held() -> None:
    def of(*held: bool | None) -> str:
        return verdict([{"held": it} for it in held], stopped=False, cut_short=False)

    assert of(True, True) == "held"
    assert of(True, None) == of() == "not checked"
    assert of(True, None, False) == "failed"
