"""The kernel against the in-process reference: every signal of every tick, bit for bit."""

import inspect
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from agents import guard
from bridge.process.lifecycle import Stop
from configs.loading import load
from configs.resolve import schedule
from configs.scenario import Scenario
from configs.signals import PLANT_SIGNALS, age_signals
from fleetloop.sweep.kernel import KernelOutcome, lacks, loop, run
from fleetloop.sweep.kernel.layout import CONTROLLER_SIGNALS
from fleetloop.sweep.kernel.lowering import lowered
from fleetloop.sweep.kernel.outcome import columns
from fleetloop.sweep.kernel.reference import referred
from fleetloop.sweep.kernel.run import Loop
from fleetloop.sweep.kernel.stops import NOT_FINITE, stop_events

AGES = age_signals(("r1", "r2", "r3", "r4", "r5"))
ALL = {signal.name for signal in (*PLANT_SIGNALS, *CONTROLLER_SIGNALS, *AGES)}


def of_kernel(scenario: Scenario) -> KernelOutcome:
    (outcome,) = run([scenario], ALL, Stop())
    return outcome


def assert_identical(found: KernelOutcome, wanted: KernelOutcome) -> None:
    """Events, stops, and the bits of every number."""
    assert found.events == wanted.events
    assert found.stopped == wanted.stopped
    assert found.record.robots == wanted.record.robots
    assert found.record.signals == wanted.record.signals
    for source in ("plant", "controller"):
        of_found: Mapping[str, np.ndarray] = getattr(found.record, source)
        of_wanted: Mapping[str, np.ndarray] = getattr(wanted.record, source)
        for robot in found.record.robots:
            assert of_found[robot].dtype == of_wanted[robot].dtype
            for name in of_found[robot].dtype.names or ():
                pair = [np.ascontiguousarray(it[robot][name]) for it in (of_found, of_wanted)]
                bits = [values.view(np.int64) for values in pair]
                assert np.array_equal(*bits), (source, robot, name)


def assert_as_reference(scenario: Scenario) -> None:
    assert lacks(scenario) == ""
    found = of_kernel(scenario)
    assert found.left_course == ""
    assert_identical(found, referred(scenario, Stop(), ""))


SHIPPED = {
    "paper": 0.3,
    "paper_ring": 0.2,
    "paper_star": 0.15,
    "paper_tree": 0.15,
    "paper_extra": 0.2,
    "two_robots": 0.3,
    "moving_leader": 0.15,
    "figure_eight": 0.15,
    "spline_gate": 0.15,
    "twelve": 0.2,
    "delay_ring": 0.5,
    "lossy_chain": 0.5,
    "switching": 0.6,
    "rotating_counterexample": 0.6,
    "hundred_tree": 0.03,
}


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_scenario_leaves_the_record_of_its_run_in_process(name: str) -> None:
    assert_as_reference(load(name, [f"until_s={SHIPPED[name]}"]))


ROBUST = 'control.law="adaptive_dsc_robust"'
VARIANTS = {
    "robust law": [ROBUST],
    "robust law at its limit": [
        ROBUST,
        "control.torque_limit_wheel_N_m=0.5",
    ],
    "law of one robot": ['robot.r2.control.law="adaptive_dsc_robust"', "robot.r3.control.k1=1.0"],
    "estimates and bounds": [
        "control.kappa_hat_0=0.2",
        "control.eta=5.0",
        "control.sigma_max=0.001",
        "control.sigma_margin=0.0001",
        "control.theta_hat_0=[0,0.01,0,0.002,0,0,0.03,0]",
    ],
    "limits of the host": [
        "host.torque_limit_wheel_N_m=3.0",
        "host.torque_slew_limit_wheel_N_m_s=500.0",
    ],
    "disturbance": ["disturbance.amplitude_wheel_N_m=0.02"],
    "disturbance of one robot": [
        "robot.r2.disturbance.amplitude_wheel_N_m=0.2",
        "robot.r2.disturbance.rate_rad_s=30.0",
    ],
    "substeps": ["clock.plant_step_s=0.0003", "disturbance.amplitude_wheel_N_m=0.02"],
    "mountings": [
        "mounting.left_sign=-1",
        "mounting.gear_ratio=7.3",
        "robot.r3.mounting.right_sign=-1",
    ],
    "bodies": [
        "robot_types.etsro.wheels_in_mass=2",
        "robot.r2.body.body_mass_kg=3.1",
        "robot.r3.body.damping_left_wheel_N_m_s=0.05",
        "robot.r4.body.wheel_radius_m=0.05",
    ],
    "moving at the start": [
        ROBUST,
        "robot.r1.v_m_s=0.4",
        "robot.r1.omega_rad_s=-1.5",
        "robot.r2.s_0=0.3",
    ],
    "poses alone": ['localisation.source="external"'],
    "odometry alone": ['localisation.source="odometry"'],
    "late poses": ["localisation.delay_s=0.037"],
    "poses at once": ["localisation.delay_s=0.0", "clock.localisation_period_s=0.001"],
    "neighbours as received": ['coordination.compensation="hold"', "coordination.v_hat_0=0.6"],
    "neighbours that age": ["clock.share_period_s=0.2", "coordination.age_limit_s=0.05"],
    "weights": ["graph.weights={'r1 -> r2' = 0.5, 'leader -> r1' = 2.0}"],
    "lognormal delays and bursts of losses": [
        "network.default.delay={kind='lognormal',mean_s=0.03,std_s=0.05}",
        "network.default.loss={kind='gilbert_elliott',good_to_bad=0.2,bad_to_good=0.4}",
        "coordination.v_hat_0=0.6",
    ],
    "copies, a narrow band and a cut": [
        "network.default.delay={kind='uniform',min_s=0.0,max_s=0.05}",
        "network.default.duplication=0.4",
        "network.default.bandwidth_bit_s=40000.0",
        "network.edge=[{edges=['r2 -> r3'],reordering=false,partitions=[{from_s=0.05,to_s=0.09}]}]",
    ],
    "one emulated edge": [
        "network.edge=[{edges=['r1 -> r2'],delay={kind='constant',delay_s=0.0305}}]",
        "coordination.compensation='hold'",
    ],
    "neighbours that fall silent": [
        "network.edge=[{edges=['r1 -> r2'],partitions=[{from_s=0.04,to_s=0.12}]}]",
        "coordination.silence_limit_s=0.05",
        "coordination.age_limit_s=0.03",
    ],
    "a graph that switches under delays": [
        "graph.switch=[{at_s=0.045,edges=['r1 -> r2','r1 -> r3','r3 -> r4'],leader=['r2']},"
        "{at_s=0.1,edges=['r4 -> r2','r1 -> r3','r3 -> r4','r1 -> r4'],leader=['r1']}]",
        "network.default.delay={kind='constant',delay_s=0.03}",
    ],
    "a leader that moves": [
        "leader.steps=[{t_s=0.1,speed_m_s=-0.4,ramp_s=0.15},{t_s=0.2,speed_m_s=0.3}]",
        "coordination.v_hat_0=0.6",
    ],
    "wrapped headings": [ROBUST, "robot.r1.pose.theta_rad=11.0", "robot.r2.pose.theta_rad=-9.5"],
    "another rate": [
        ROBUST,
        "clock.control_period_s=0.005",
        "control.k4=0.36",
        "clock.plant_step_s=0.001",
    ],
    "a line": ["path={kind='line',heading_rad=0.4}"],
    "a circle": ["path={kind='circle',radius_m=2.5,start_angle_rad=0.3,clockwise=true}"],
    "offsets that turn": ["robot.r2.offset={kind='structure',ahead_m=-0.5,left_m=0.7}"],
    "offsets that vary": [
        ROBUST,
        "robot.r2.offset={kind='varying',knots=[{s_m=-0.2,ahead_m=0,left_m=0.5},"
        "{s_m=0.01,ahead_m=0.1,left_m=0},{s_m=1,ahead_m=-0.3,left_m=0}]}",
        "robot.r3.offset={kind='varying',knots=[{s_m=0,ahead_m=0,left_m=0},"
        "{s_m=2,ahead_m=0.4,left_m=-1}]}",
        "coordination.v_hat_0=0.6",
    ],
    "a closed spline": ["path={kind='spline',points_m=[[0,0],[2,0],[2,2],[0,3]],closed=true}"],
    "an open spline": [
        "path={kind='spline',points_m=[[0,0],[0.1,0],[0.2,0.1]]}",
        "coordination.v_hat_0=0.6",
    ],
}


@pytest.mark.parametrize("name", VARIANTS)
def test_what_a_scenario_may_say_is_as_in_process(name: str) -> None:
    assert_as_reference(load("paper", ["until_s=0.15", *VARIANTS[name]]))


STOPS = {
    "all at once": ["control.k4=400.0"],
    "mirrored and geared": ["control.k4=40.0", "mounting.gear_ratio=7.0", "mounting.left_sign=-1"],
    "one of four": ["robot.r1.pose.theta_rad=11.0", "robot.r2.pose.theta_rad=-9.5"],
    "in substeps, limited": [
        "control.k4=30.0",
        "clock.plant_step_s=0.0003",
        "host.torque_limit_wheel_N_m=1e12",
    ],
    "one later, seen at a later look of the plant": [
        "robot.r1.control.k4=5.4",
        "robot.r4.control.k4=400.0",
    ],
    "slow heartbeats": ["control.k4=400.0", "drive.heartbeat_period_s=0.12", "clock.countdown_s=1"],
}


@pytest.mark.parametrize("name", STOPS)
def test_robots_that_diverge_stop_as_in_process(name: str) -> None:
    scenario = load("paper", ["until_s=0.35", *STOPS[name]])
    found = of_kernel(scenario)
    assert found.left_course == ""
    assert found.stopped
    assert_identical(found, referred(scenario, Stop(), ""))


def test_a_torque_that_is_no_number_stops_its_robot_alone() -> None:
    scenario = load("paper", ["until_s=0.05"])
    ticks = schedule(scenario)
    made = lowered(scenario, ticks)
    robots = made.robots.copy()
    robots["k1"][1] = np.inf
    kept = columns(frozenset({"tau_right_wheel_N_m", "x_e_m"}))
    room = [one.rows(4, ticks.ticks, ticks.period_ns) for one in kept]
    why, *_ = Loop().run(made._replace(robots=robots), kept, (room[0][0], room[1][0]))
    assert why == loop.NOTHING
    assert made.states["stopped"].tolist() == [loop.GOING, loop.TORQUE, loop.GOING, loop.GOING]
    assert not room[1][1]["tau_right_wheel_N_m"][1].any()
    assert room[1][1]["tau_right_wheel_N_m"][0].all()
    assert [event.text for event in stop_events(scenario, "r2", made.states[1])] == [NOT_FINITE]
    assert f'"{NOT_FINITE}"' in inspect.getsource(guard)


def test_a_graph_that_is_drawn_is_as_in_process() -> None:
    drawn = {"graph.edges": None, "graph.leader": None, "graph.generator": "random"}
    assert_as_reference(load("paper", ["until_s=0.15"]).with_(drawn))


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Random cases of a sweep."""

    def number(low: float, high: float) -> float:
        return draw(st.floats(low, high))

    sets = [
        "until_s=0.05",
        f"control.law={draw(st.sampled_from(['adaptive_dsc', 'adaptive_dsc_robust']))}",
        f"control.k4={number(0.1, 4.0)}",
        f"control.gamma_1_s={number(0.005, 0.2)}",
        f"control.k5={[number(0.0, 1.0) for _ in range(8)]}",
        f"coordination.p={number(0.5, 4.0)}",
        f"coordination.q={number(0.1, 4.0)}",
        f"leader.speed_m_s={number(-1.0, 1.0)}",
        f"seed={draw(st.integers(0, 1000))}",
    ]
    for robot in ("r1", "r2", "r3", "r4"):
        sets += [
            f"robot.{robot}.pose.x_m={number(-9.0, 3.0)}",
            f"robot.{robot}.pose.y_m={number(-6.0, 6.0)}",
            f"robot.{robot}.pose.theta_rad={number(-7.0, 7.0)}",
            f"robot.{robot}.body.body_mass_kg={number(1.0, 9.0)}",
        ]
    return load("paper", sets)


@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))
@given(scenarios())
def test_random_cases_are_as_in_process(scenario: Scenario) -> None:
    assert_identical(of_kernel(scenario), referred(scenario, Stop(), ""))
