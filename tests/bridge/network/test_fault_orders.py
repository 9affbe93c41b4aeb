"""Orders of faults: their bytes, the tick at which they act, and what is none."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.fault_schedule import FaultSchedule
from bridge.network.fault_orders import FaultOrder, targets_to
from bridge.network.packing import pack, unpack
from configs.events import Event
from configs.faults.bodies import Push
from configs.faults.kinds import KINDS
from configs.faults.messages import LinkLoss

PUSH = Push(kind="push", at_s=0.0, force_body_N=4.0)


def order(fault=PUSH, **changes) -> FaultOrder:
    values = {"from_tick": 0, "ticks": 10, "exact": False} | changes
    return FaultOrder(7, False, "shove", ("r1", "r2"), fault, **values)


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_of_every_kind_comes_out_as_it_went_in(kind: str) -> None:
    sent = order(KINDS[kind](kind=kind, at_s=0.0), ticks=None)
    assert FaultOrder.decode(sent.encode()) == sent


WRONG = st.one_of(
    st.none(), st.floats(), st.text(max_size=3), st.just(2**63), st.just([[]]), st.just({"a": 1})
)


@given(st.integers(1, 8), WRONG)
def test_a_field_of_the_wrong_type_is_no_order_or_a_sound_one(place: int, value) -> None:
    fields = unpack(order().encode(), 9)
    assert fields is not None
    fields[place] = value
    read = FaultOrder.decode(pack(*fields[1:]))
    if read is not None:
        assert FaultOrder.decode(read.encode()) == read
        assert type(read.name) is str
        assert read.ticks is None or type(read.ticks) is int


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": "pusch"},
        {"force_body_N": "4"},
        {"force_body_N": float("nan")},
        {"force": 4.0},
        {"at_s": 1.0},
        {"kind": "link_loss", "probability": 1.5},
        {"kind": "link_loss", "edges": []},
    ],
)
def test_a_table_that_the_scenario_would_refuse_is_no_order(changes: dict) -> None:
    table = {"kind": "push"} | changes
    assert FaultOrder.decode(pack(7, False, "shove", ["r1"], table, 0, None, False)) is None


def test_it_acts_at_the_earliest_tick_unless_a_later_one_is_wanted() -> None:
    assert order().tick(500, 6000) == 500
    assert order(from_tick=900).tick(500, 6000) == 900
    assert order(from_tick=900, exact=True).tick(500, 6000) == 900
    assert order().tick(-20, 6000) == 0


def test_a_tick_that_has_gone_is_refused_if_it_had_to_be_that_one_and_so_is_the_end() -> None:
    assert "tick 400 has gone" in str(order(from_tick=400, exact=True).tick(500, 6000))
    assert "the run ends before" in str(order(from_tick=6000).tick(500, 6000))


def test_it_acts_on_its_targets_from_a_tick_on_as_a_listed_fault_does() -> None:
    one, other = FaultSchedule([]), FaultSchedule([])
    schedules = {"r1": one, "r2": other}
    assert order().act(schedules, 50, 0.002) == 50
    assert [it.event for it in one.due(50)] == [Event(50, "r1", "fault_applied", "shove (push)")]
    (planned,) = one.acting
    assert (planned.from_tick, planned.to_tick, planned.fault.at_s) == (50, 60, 0.1)
    assert order().act(schedules, 52, 0.002) == 52  # told again: nothing changes
    assert one.due(52) == []
    assert order()._replace(ends=True).act(schedules, 55, 0.002) == 55
    assert [it.event for it in one.due(55)] == [Event(55, "r1", "fault_cleared", "shove (push)")]
    assert "r2: nothing here" in str(order().act({"r1": one}, 70, 0.002))
    assert one.next_tick > 10**6  # nothing of a refused order is left


def test_a_controller_is_concerned_by_its_robot_and_by_the_edges_to_it() -> None:
    targets = ("r1", "r2 -> r1", "r1 -> r2", "leader -> r1")
    assert targets_to(targets, "r1") == ("r1", "r2 -> r1", "leader -> r1")
    assert LinkLoss.PLACE == "agent"
