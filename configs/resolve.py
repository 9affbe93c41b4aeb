"""Scenario → briefs: what each process of a run receives at its start."""

from collections.abc import Iterable
from math import inf

from configs import sections
from configs.brief import (
    ROWS_WITHIN_NS,
    AgentBrief,
    ChannelModel,
    DriveLink,
    DriveModel,
    HostLimits,
    LeaderBrief,
    MotorModel,
    PlantBrief,
    PowertrainModel,
    RobotBrief,
    Schedule,
    WheelDisturbance,
    Wheels,
    WireModel,
    channel_seed,
)
from configs.connections import OURS, NetworkLink, Settings
from configs.curves import formation_offset, reference_path
from configs.drives import Drive
from configs.edges import hearer
from configs.emulated_edges import effects_to
from configs.faults.absences import absences
from configs.faults.base import PlannedFault
from configs.faults.plan import faulted_sources, planned_faults
from configs.leader_speed import SpeedChange
from configs.parameters import extended
from configs.scenario import Scenario
from configs.signals import Signal, controller_signals

ENCODER_AGE_LIMIT_S = 0.05
"""Machines that are no real-time machines stand still for 10 ms now and then; drives' watchdogs
allow 100 ms."""
POSE_AGE_LIMIT_S = 0.5
START_DEADLINE_S, START_DEADLINE_PER_ROBOT_S = 20.0, 0.5
TICK_DEADLINE_S, TICK_DEADLINE_PER_ROBOT_S = 2.0, 0.02
"""On two busy cores a tick of 250 robots takes up to 0.7 s."""
HELLO_EVERY_S, HELLO_EVERY_PER_ROBOT_S = 0.02, 0.001
"""All processes send hellos at once, so those of a large fleet are less frequent."""
STATUS_EVERY_S, STATUS_EVERY_PER_ROBOT_S = 0.1, 0.0125
"""What processes say for people costs the launcher at most 80 messages a second."""
RARE_STATUS_S, RARE_STATUS_PER_ROBOT_S = 1.0, 0.004
"""Of a large fleet every second, until that is more than 250 messages a second."""
ROWS_WITHIN_PER_ROBOT_NS = 2_500_000
"""Blocks of rows of a large fleet are handed on less often, 800 in a second from all processes."""
SERIAL_NUMBER = 0x3858_0000_0000


def schedule(scenario: Scenario, speed: float = 0.0, *, profile: bool = False) -> Schedule:
    """The ticks of a run; held to a slow `speed`, all processes wait longer for the next."""
    clock = scenario.clock
    h = clock.control_period_s
    delay_s = scenario.localisation.delay_s
    robots = len(scenario.robot)
    tick_deadline_s = clock.tick_deadline_s or max(
        TICK_DEADLINE_S, TICK_DEADLINE_PER_ROBOT_S * robots
    )
    return Schedule(
        period_ns=round(h * 1e9),
        ticks=round(scenario.ends_at_s / h),
        countdown_ticks=round(clock.countdown_s / h),
        share_every=round(clock.share_period_s / h),
        localise_every=round(clock.localisation_period_s / h),
        pose_delay_ticks=1 if delay_s is None else round(delay_s / h),
        tick_deadline_s=tick_deadline_s + (h / speed if speed > 0 else 0.0),
        start_deadline_s=clock.start_deadline_s
        or max(START_DEADLINE_S, START_DEADLINE_PER_ROBOT_S * robots),
        hello_every_s=max(HELLO_EVERY_S, HELLO_EVERY_PER_ROBOT_S * robots),
        realtime=clock.mode == "realtime",
        on_late="abort" if clock.mode == "realtime" else clock.on_late,
        profile=profile,
        status_every_s=max(
            STATUS_EVERY_S,
            min(STATUS_EVERY_PER_ROBOT_S * robots, RARE_STATUS_S),
            RARE_STATUS_PER_ROBOT_S * robots,
        ),
        rows_within_ns=max(ROWS_WITHIN_NS, ROWS_WITHIN_PER_ROBOT_NS * robots),
    )


def agent_brief(
    scenario: Scenario,
    name: str,
    *,
    network: NetworkLink,
    bus: Settings,
    speed: float = 0.0,
    profile: bool = False,
) -> AgentBrief:
    """The brief of the controller of robot `name`."""
    robot = next(robot for robot in scenario.robot if robot.name == name)
    body = scenario.body_of(robot)
    graph = scenario.topology
    drive = _drive_model(scenario, 0)
    ticks = schedule(scenario, speed, profile=profile)
    return AgentBrief(
        robot=name,
        law=scenario.control_of(robot),
        signals=signals_of(scenario, robot),
        wheels=Wheels(body.wheel_radius_m, body.half_track_m),
        coordination=scenario.coordination,
        s_0=robot.s_0,
        reach=scenario.reach,
        path=reference_path(scenario.path),
        offset=formation_offset(robot.offset),
        hears=graph.hears[name],
        leader_link=graph.links.get(name),
        membership=scenario.members[name],
        localisation=scenario.localisation.source,
        schedule=ticks,
        drives=_drive_link(scenario, robot, drive),
        host=_host_limits(scenario, ours=dict(bus).get("interface", OURS) == OURS),
        channels=channels(scenario, name),
        faults=agent_faults(planned_faults(scenario), name),
        seed=scenario.seed,
        phase_ns=round((scenario.names.index(name) + 0.5) * ticks.period_ns / len(scenario.names)),
        bus=bus,
        network=network,
        logs_inputs=scenario.records_inputs,
    )


def channels(scenario: Scenario, name: str) -> tuple[ChannelModel, ...]:
    """The emulated edges to a robot, without those that have no effects."""
    effects_by_source = effects_to(
        scenario.network, scenario.topology, name, faulted=faulted_sources(scenario, name)
    )
    return tuple(
        extended(
            ChannelModel, effects, source=source, seed=channel_seed(scenario.seed, source, name)
        )
        for source, effects in effects_by_source.items()
    )


def agent_faults(faults: Iterable[PlannedFault], name: str) -> tuple[PlannedFault, ...]:
    """Those of a robot's messages and of its process."""
    return tuple(one for one in faults if one.fault.PLACE != "plant" and hearer(one.target) == name)


def signals_of(scenario: Scenario, robot: sections.Robot) -> tuple[Signal, ...]:
    """The recorded signals of a robot's controller, one row per tick."""
    return controller_signals(scenario.control_of(robot).load().SIGNALS, scenario.aged(robot.name))


def _drive_link(scenario: Scenario, robot: sections.Robot, drive: DriveModel) -> DriveLink:
    host = scenario.host
    right_node, left_node = scenario.nodes_of(robot.name)
    encoder_age_s = host.encoder_age_limit_s
    if encoder_age_s is None:
        encoder_age_s = max(ENCODER_AGE_LIMIT_S, 10 * scenario.clock.control_period_s)
    return DriveLink(
        choice=drive.choice,
        limited=drive.limited,
        right_node=right_node,
        left_node=left_node,
        encoder_period_ns=drive.encoder_period_ns,
        encoder_age_limit_ns=round(encoder_age_s * 1e9),
        heartbeat_age_limit_ns=round(host.heartbeat_age_limit_s * 1e9),
        mounting=scenario.mounting_of(robot),
    )


def pose_age_limit_s(scenario: Scenario) -> float:
    """The age of its newest pose at which a robot stops, where poses come from outside [s]."""
    if scenario.host.pose_age_limit_s is not None:
        return scenario.host.pose_age_limit_s
    delay_s = scenario.localisation.delay_s or scenario.clock.control_period_s
    return max(POSE_AGE_LIMIT_S, delay_s + 5 * scenario.clock.localisation_period_s)


def _host_limits(scenario: Scenario, *, ours: bool) -> HostLimits:
    host = scenario.host
    fixes = scenario.localisation.source != "odometry"
    return extended(
        HostLimits,
        host,
        torque_limit_wheel_N_m=_or_none(host.torque_limit_wheel_N_m),
        torque_slew_limit_wheel_N_m_s=_or_none(host.torque_slew_limit_wheel_N_m_s),
        encoder_mismatch_limit_wheel_rad=_or_none(host.encoder_mismatch_limit_wheel_rad),
        pose_mismatch_limit_m=_or_none(host.pose_mismatch_limit_m),
        pose_age_limit_ns=_ns(pose_age_limit_s(scenario)) if fixes else 0,
        rearm_after_ns=_ns(host.rearm_after_s),
        rearm_limit_ns=_ns(host.rearm_limit_s),
        # Our own bus fails when the plant is gone, and doesn't come back.
        bus_error_limit_ns=0 if ours else _ns(host.bus_error_limit_s),
    )


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)


def _or_none(limit: float | None) -> float:
    return inf if limit is None else limit


def substeps(clock: sections.Clock, period_ns: int) -> int:
    """Integration steps per control period."""
    return max(1, -(-period_ns // _ns(clock.plant_step_s)))


def plant_brief(
    scenario: Scenario,
    *,
    network: NetworkLink,
    speed: float = 0.0,
    profile: bool = False,
) -> PlantBrief:
    """The brief of the plant."""
    ticks = schedule(scenario, speed, profile=profile)
    return PlantBrief(
        robots=robot_briefs(scenario),
        schedule=ticks,
        substeps=substeps(scenario.clock, ticks.period_ns),
        speed=speed,
        seed=scenario.seed,
        wire=wire_model(scenario),
        traffic=bool(scenario.bus.record),
        faults=tuple(one for one in planned_faults(scenario) if one.fault.PLACE == "plant"),
        absences=() if ticks.realtime else absences(planned_faults(scenario), ticks.ticks),
        network=network,
    )


def robot_briefs(scenario: Scenario) -> tuple[RobotBrief, ...]:
    """All robots as the plant sees them."""
    return tuple(_robot(scenario, n, robot) for n, robot in enumerate(scenario.robot, 1))


def wire_model(scenario: Scenario) -> WireModel | None:
    """Model of the emulated buses; None: frames take no time."""
    bus = scenario.bus
    if bus.timing == "ideal":
        return None
    return extended(
        WireModel,
        bus,
        restart_ns=None if bus.restart_s is None else _ns(bus.restart_s),
        drive_restart_ns=None if bus.drive_restart_s is None else _ns(bus.drive_restart_s),
    )


def leader_brief(scenario: Scenario) -> LeaderBrief:
    """The speed of the virtual leader from the start on, and its changes."""
    return LeaderBrief(speed_changes(scenario.leader))


def speed_changes(leader: sections.Leader) -> tuple[SpeedChange, ...]:
    """v_r(t), in order of time."""
    later = (SpeedChange(_ns(one.t_s), one.speed_m_s, _ns(one.ramp_s)) for one in leader.steps)
    return (SpeedChange(0, leader.speed_m_s), *later)


def _robot(scenario: Scenario, number: int, robot: sections.Robot) -> RobotBrief:
    right_node, left_node = scenario.nodes_of(robot.name)
    return RobotBrief(
        robot=robot.name,
        bus=scenario.bus_of(robot.name),
        body=scenario.body_of(robot),
        disturbance=extended(
            WheelDisturbance, robot.disturbance or scenario.disturbance, phase_rad=float(number)
        ),
        drive=_drive_model(scenario, number),
        powertrain=_powertrain_model(scenario, number),
        ideal_powertrain=scenario.drive.preset != "realistic",
        right_node=right_node,
        left_node=left_node,
        pose=robot.pose,
        v_m_s=robot.v_m_s,
        omega_rad_s=robot.omega_rad_s,
        mounting=scenario.mounting_of(robot),
    )


def _drive_model(scenario: Scenario, number: int) -> DriveModel:
    drive = scenario.drive
    return DriveModel(
        choice=scenario.drive_choice,
        limited=drive.preset != "ideal",
        serial_number=SERIAL_NUMBER + 2 * number,
        encoder_period_ns=_ns(drive.encoder_period_s or scenario.clock.control_period_s),
        command_latency_ns=_latency_ns(drive),
    )


def _latency_ns(drive: Drive) -> tuple[int, int]:
    if drive.preset != "realistic":
        return 0, 0
    least_s, most_s = drive.command_latency_s
    return _ns(least_s), _ns(most_s)


def _powertrain_model(scenario: Scenario, number: int) -> PowertrainModel:
    drive, motor = scenario.drive, scenario.motor
    constant, limit = motor.torque_constant_N_m_A, motor.current_limit_A
    return PowertrainModel(
        motor=extended(
            MotorModel,
            motor,
            torque_constant_N_m_A=drive.torque_constant_N_m_A if constant is None else constant,
            current_limit_A=drive.current_limit_A if limit is None else limit,
            assumed_torque_constant_N_m_A=drive.torque_constant_N_m_A,
        ),
        encoder=scenario.encoder,
        supply=scenario.supply,
        seed=(scenario.seed << 9) + number,  # at most 256 robots
    )
