"""What nothing on the bus, at the encoder or at the motor can make an axis do."""

from functools import cache
from importlib import resources
from math import inf, isfinite, nan
from struct import pack

import cantools
from cantools.database import Database
from hypothesis import given, settings
from hypothesis import strategies as st
from support.odrive_axis import MODEL, MS, NODE, arm, axis, torque

from bridge.drives.interface import DriveMeasurements
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisState, Command
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import RTR, Frame

SET_POINTS = {Command.SET_INPUT_TORQUE, Command.SET_INPUT_VEL, Command.SET_INPUT_POS}
values = st.sampled_from([0.0, -0.0, 1.0, -1.0, nan, inf, -inf, 3.4e38, -3.4e38, 1e-45, 50.0])
data = (
    st.binary(max_size=8)
    | values.map(lambda v: pack("<f", v))
    | st.tuples(values, values).map(lambda v: pack("<ff", *v))
    | st.tuples(st.integers(0, 15), st.integers(0, 9)).map(lambda v: pack("<II", *v))
    | st.integers(0, 60).map(lambda n: pack("<BHBf", 1, n, 0, 2.5))
)
ours = st.sampled_from(list(Command)).map(lambda command: f.identifier(NODE, command))
anyone = st.integers(0, 0x7FF) | st.integers(0, 2**32 - 1)
heard = st.builds(Frame, ours | ours | ours.map(lambda i: i | RTR) | anyone, data)
arming = st.just(Frame(f.identifier(NODE, Command.SET_AXIS_STATE), pack("<I", 8)))
clearing = st.just(Frame(f.identifier(NODE, Command.CLEAR_ERRORS), b"\0"))
fed = st.tuples(values | st.floats(), values | st.floats())
felt = st.builds(DriveMeasurements, *[values | st.floats(-200.0, 200.0)] * 6)
healthy = st.just(DriveMeasurements(0.0, 0.0, 30.0, nan, 24.0, 0.0))
waits = st.integers(0, 300 * MS)
happenings = st.lists(heard | arming | clearing | fed | felt | healthy | waits, max_size=40)
variants = st.fixed_dictionaries(
    {
        "torque_limiters": st.booleans(),
        "zero_torque_on_disarm": st.booleans(),
        "watchdog_ns": st.sampled_from([0, 100 * MS]),
        "calibrated": st.booleans(),
        "calibration_ns": st.sampled_from([1, 50 * MS]),
        "boot_ns": st.sampled_from([0, 30 * MS]),
        "firmware": st.sampled_from([(0, 6, 10), (0, 6, 11)]),
        "torques_period_ns": st.sampled_from([0, 10 * MS]),
        "iq_period_ns": st.sampled_from([0, 7 * MS]),
    }
)


@cache
def dbc() -> Database:
    text = resources.files("odrive_can").joinpath("dbc/odrive-cansimple-0.6.10.dbc").read_text()
    return cantools.database.load_string(text, "dbc")


def decodes(frame: Frame) -> bool:
    # Node ids of the DBC end at 7: the message is the same for all others.
    message = dbc().get_message_by_frame_id(frame.can_id & 0x1F)
    message.decode(frame.data, decode_choices=False)
    return len(frame.data) == message.length


@settings(max_examples=150, deadline=None)
@given(variants, happenings)
def test_nothing_raises_or_yields_a_torque_that_is_not_finite_or_not_armed(changes, all_) -> None:
    node, now_ns = axis(**changes), 0
    for happening in all_:
        sent: list[Frame] = []
        match happening:
            case DriveMeasurements():
                node.update_measurements(happening)
            case Frame():
                sent += node.on_frame(happening, now_ns)
            case int():
                now_ns += happening
            case (revolutions, rev_s):
                node.update_encoder(revolutions, rev_s)
        sent += node.due(now_ns)
        assert node.next_due_ns > now_ns
        demand = node.torque_demand_shaft(0.001)
        assert isfinite(demand)
        assert isfinite(node.input_torque_shaft)
        if node.state is not AxisState.CLOSED_LOOP_CONTROL:
            assert demand == 0.0
        assert all(decodes(frame) for frame in sent)
        assert all(frame.can_id >> f.BITS == node.node_id for frame in sent)


@settings(max_examples=100, deadline=None)
@given(st.lists(heard, max_size=20))
def test_nothing_but_a_set_point_or_arming_feeds_the_watchdog(sent: list[Frame]) -> None:
    node = arm(axis())
    for t, frame in enumerate(sent, 1):
        before = node.fed_ns
        state = node.state
        node.on_frame(frame, t)
        if node.fed_ns == before or not node.fed_ns:
            continue
        armed = state is not AxisState.CLOSED_LOOP_CONTROL is node.state
        watchdog_enabled = frame.can_id & 0x1F == Command.RX_SDO  # counts from then on
        set_point = frame.can_id in {f.identifier(node.node_id, command) for command in SET_POINTS}
        assert armed or watchdog_enabled or set_point


@settings(deadline=None)
@given(variants, happenings)
def test_calling_due_only_when_it_says_so_misses_nothing(changes, all_) -> None:
    often, seldom = axis(**changes), axis(**changes)
    now_ns = 0

    def both(until_ns: int) -> None:
        while (at_ns := seldom.next_due_ns) < until_ns:
            assert seldom.due(at_ns) == often.due(at_ns)
            assert not often.due(at_ns)

    for happening in all_:
        match happening:
            case Frame():
                both(now_ns)
                assert seldom.on_frame(happening, now_ns) == often.on_frame(happening, now_ns)
            case int() if happening < 30 * MS:
                now_ns += happening
                both(now_ns)
                if seldom.next_due_ns > now_ns:
                    assert not often.due(now_ns)
        assert seldom.state is often.state
        assert seldom.errors == often.errors


@given(st.floats(-1e3, 1e3), st.integers(1, 10**9))
def test_the_watchdog_trips_at_its_time_and_not_before(value: float, late_ns: int) -> None:
    for when_ns, alive in ((100 * MS, True), (100 * MS + late_ns, False)):
        node = OdriveNode(MODEL, NODE, 1)
        arm(node, 5)
        torque(node, value, 7)
        assert node.next_due_ns <= 7 + 100 * MS + 1
        torque(node, 0.0, 7 + when_ns)  # too late a set-point doesn't save it
        assert (node.state is AxisState.CLOSED_LOOP_CONTROL) is alive
