"""One emulated robot: body, and behind each wheel a drive, a motor and an encoder.

    bus frames ─► drive ─torque demand─► motor ─torque─► body ─wheel angle, speed─► encoder ─► drive

A robot is told the time and never asks for it. A step of the integration holds the torques.
Drives, motors and encoders are at the motor shaft, the body and what is recorded at the wheel:

    wheel torque = gear × shaft torque,  shaft angle = gear × wheel angle,  gear = sign × gear ratio

    EmulatedRobot     ideal motors and encoders: a drive's demand acts at once, its encoder is exact
    RealisticRobot    motors, supply and encoders of `plant.powertrain`
"""

from collections.abc import Iterable, Mapping, Sequence

from bridge.drives import protocol
from bridge.drives.interface import DriveMeasurements, DriveNode
from bridge.frame import Frame
from bridge.network.messages import PoseFix
from configs.brief import PowertrainModel, RobotBrief
from configs.events import Event, when
from plant.body import RigidBody, State
from plant.divergence import Divergence
from plant.encoder import PER_RADIAN
from plant.integrate import rk4
from plant.powertrain import powertrain

MEASURE_EVERY_S = 0.001
"""Shortest period at which a drive's firmware reads its thermistors and currents."""


class EmulatedRobot:
    """One robot on its bus."""

    __slots__ = (
        "_answered_ns",
        "_body",
        "_demand_left_wheel_N_m",
        "_demand_right_wheel_N_m",
        "_gear_left",
        "_gear_right",
        "_left",
        "_push_left_wheel_N_m",
        "_push_right_wheel_N_m",
        "_right",
        "_torque_left_wheel_N_m",
        "_torque_right_wheel_N_m",
        "brief",
        "divergence",
        "drives",
        "moved_ns",
        "state",
    )

    def __init__(self, brief: RobotBrief) -> None:
        node = protocol(brief.drive.choice.plugin).node
        self.brief = brief
        self._body = RigidBody(brief.body, brief.disturbance)
        self._right = node(brief.drive, brief.right_node, brief.drive.serial_number)
        self._left = node(brief.drive, brief.left_node, brief.drive.serial_number + 1)
        self.drives: tuple[DriveNode, DriveNode] = (self._right, self._left)
        self.divergence: Divergence | None = None
        """The reason why the body is held for good, None if it moves."""
        self.moved_ns = 0
        """Bus time up to which the body has moved, where it moves from event to event."""
        mounting = brief.mounting
        self._gear_right = mounting.right_sign * mounting.gear_ratio
        self._gear_left = mounting.left_sign * mounting.gear_ratio
        self._answered_ns = 0
        self._demand_right_wheel_N_m = self._demand_left_wheel_N_m = 0.0
        self._torque_right_wheel_N_m = self._torque_left_wheel_N_m = 0.0
        self._push_right_wheel_N_m = self._push_left_wheel_N_m = 0.0
        pose = brief.pose
        self.state = State(
            pose.x_m, pose.y_m, pose.theta_rad, brief.v_m_s, brief.omega_rad_s, 0.0, 0.0
        )

    def update_encoders(self) -> None:
        """Hand both drives the position and speed of their encoders."""
        state = self.state
        right_speed, left_speed = self._body.wheel_speeds(state.v, state.omega)
        right, left = PER_RADIAN * self._gear_right, PER_RADIAN * self._gear_left
        self._right.update_encoder(state.right_wheel_rad * right, right_speed * right)
        self._left.update_encoder(state.left_wheel_rad * left, left_speed * left)

    def feedback(self, now_ns: int) -> Sequence[Frame]:
        """Both encoder frames, once both drives have taken a set-point since the last ones."""
        if min(self._right.fed_ns, self._left.fed_ns) <= self._answered_ns:
            return ()
        self._answered_ns = now_ns
        self.update_encoders()
        return self._right.feedback(now_ns), self._left.feedback(now_ns)

    def frames_due(self, now_ns: int) -> list[Frame]:
        """The frames that both drives send at this instant, in order of arbitration."""
        self.update_encoders()
        frames = [*self._right.due(now_ns), *self._left.due(now_ns)]
        if len(frames) > 1:
            frames.sort()
        return frames

    def on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Give one frame from the bus to the drives that it may concern; return their replies."""
        can_id, right, left = frame[0], self._right, self._left
        if can_id == right.setpoint_id != left.setpoint_id:
            return right.on_frame(frame, now_ns)
        if can_id == left.setpoint_id != right.setpoint_id:
            return left.on_frame(frame, now_ns)
        replies = right.on_frame(frame, now_ns), left.on_frame(frame, now_ns)
        return [*replies[0], *replies[1]] if any(replies) else ()

    def advance(self, t_s: float, period_s: float, substeps: int) -> None:
        """Integrate one control period from scenario time `t_s`, torques held."""
        state = self.state
        right = self._right.torque_demand_shaft(period_s) * self._gear_right
        left = self._left.torque_demand_shaft(period_s) * self._gear_left
        self._torque_right_wheel_N_m = self._demand_right_wheel_N_m = right
        self._torque_left_wheel_N_m = self._demand_left_wheel_N_m = left
        if self.divergence is not None:
            return
        step = period_s / substeps
        for n in range(substeps):
            after = rk4(
                self._body,
                state,
                right + self._push_right_wheel_N_m,
                left + self._push_left_wheel_N_m,
                t_s + n * step,
                step,
            )
            if after is None:
                state = self._stop(state, Divergence(t_s, state.v, state.omega, right, left))
                break
            state = after
        self.state = state

    # --- faults ------------------------------------------------------------------------------

    def clear_faults(self) -> None:
        """All faults of before end; what they did stays done."""
        self._push_right_wheel_N_m = self._push_left_wheel_N_m = 0.0

    def push(self, force_body_N: float, torque_body_N_m: float) -> None:
        """From now on a force along the body's axis and a torque act on it, beside others.

        They are as wheel torques r F/2 ± r T/(2 b): (4) multiplied by the body's inertia.
        """
        along = 0.5 * self._body.r * force_body_N
        turning = 0.5 * self._body.r / self._body.b * torque_body_N_m
        self._push_right_wheel_N_m += along + turning
        self._push_left_wheel_N_m += along - turning

    # --- motion ------------------------------------------------------------------------------

    def pose_fix(self, tick: int, t_ns: int) -> PoseFix:
        """The pose as the localisation system sees it now."""
        state = self.state
        return PoseFix(tick, t_ns, state.x, state.y, state.theta)

    def move(self, to_ns: int, zero_ns: int, step_ns: int) -> None:
        """Move on to a bus time, in steps of at most `step_ns`, and tell the drives where that is.

        Before `zero_ns` the body is held; time doesn't go back.
        """
        from_ns = max(self.moved_ns, zero_ns)
        if to_ns > from_ns:
            span_ns = to_ns - from_ns
            self.advance((from_ns - zero_ns) * 1e-9, span_ns * 1e-9, -(-span_ns // step_ns))
        if to_ns > self.moved_ns:
            self.moved_ns = to_ns
            self.update_encoders()

    def _stop(self, sound: State, divergence: Divergence) -> State:
        """The motion diverged: the state at rest where it was sound at last."""
        self.divergence = divergence
        self._right.lose_estimate()
        self._left.lose_estimate()
        return sound._replace(v=0.0, omega=0.0)

    def row(self, t_s: float) -> tuple[float, ...]:
        """The signals of `configs.signals.PLANT_SIGNALS` at this instant."""
        x, y, theta, v, omega, _, _ = self.state
        return (
            t_s,
            x,
            y,
            theta,
            v,
            omega,
            self._right.input_torque_shaft * self._gear_right,
            self._left.input_torque_shaft * self._gear_left,
            self._demand_right_wheel_N_m,
            self._demand_left_wheel_N_m,
            self._torque_right_wheel_N_m,
            self._torque_left_wheel_N_m,
        )


class RealisticRobot(EmulatedRobot):
    """One robot with real motors, supply and encoders."""

    __slots__ = ("_train", "_unmeasured_s")

    def __init__(self, brief: RobotBrief, model: PowertrainModel) -> None:
        super().__init__(brief)
        self._train = powertrain(model, self._shaft_inertia(brief.mounting.gear_ratio))
        self._unmeasured_s = 0.0

    def _shaft_inertia(self, gear_ratio: float) -> float:
        """The least inertia that a motor turns, at its shaft [kg·m²]."""
        return min(self._body.mbar_1, self._body.mbar_2) / (gear_ratio * gear_ratio)

    def update_encoders(self) -> None:
        """The encoders have told their drives already, at every step."""

    def advance(self, t_s: float, period_s: float, substeps: int) -> None:
        """Integrate one span from scenario time `t_s`; drives, motors and encoders step with it."""
        step = period_s / substeps
        state, body, train = self.state, self._body, self._train
        right, left = self._right, self._left
        gear_r, gear_l = self._gear_right, self._gear_left
        demands = torques = (0.0, 0.0)
        for n in range(substeps):
            demands = right.torque_demand_shaft(step), left.torque_demand_shaft(step)
            right_speed, left_speed = body.wheel_speeds(state.v, state.omega)
            shafts = train.step(demands, (right_speed * gear_r, left_speed * gear_l), step)
            torques = shafts[0] * gear_r, shafts[1] * gear_l
            if self.divergence is None:
                after = rk4(
                    body,
                    state,
                    torques[0] + self._push_right_wheel_N_m,
                    torques[1] + self._push_left_wheel_N_m,
                    t_s + n * step,
                    step,
                )
                if after is None:
                    after = self._stop(state, Divergence(t_s, state.v, state.omega, *torques))
                state = after
            right.update_encoder(*train.right_encoder.step(state.right_wheel_rad * gear_r, step))
            left.update_encoder(*train.left_encoder.step(state.left_wheel_rad * gear_l, step))
        self.state = state
        self._demand_right_wheel_N_m, self._demand_left_wheel_N_m = (
            demands[0] * gear_r,
            demands[1] * gear_l,
        )
        self._torque_right_wheel_N_m, self._torque_left_wheel_N_m = torques
        self._unmeasured_s += period_s
        if self._unmeasured_s >= MEASURE_EVERY_S:
            self._unmeasured_s = 0.0
            self._measure()

    def _measure(self) -> None:
        """Tell both drives what they measure of their motors and of the supply."""
        train = self._train
        supply = train.supply
        for drive, motor, amps in (
            (self._right, train.right_motor, supply.right_A),
            (self._left, train.left_motor, supply.left_A),
        ):
            torque, current = motor.measure()
            drive.update_measurements(
                DriveMeasurements(torque, current, motor.fet_C, motor.motor_C, supply.bus_V, amps)
            )


def emulated_robot(brief: RobotBrief) -> EmulatedRobot:
    """The emulation of a robot as its brief wants it."""
    return (
        EmulatedRobot(brief)
        if brief.powertrain is None
        else RealisticRobot(brief, brief.powertrain)
    )


def bus_troubles(troubles: Mapping[str, str], robots: Iterable[EmulatedRobot]) -> dict[str, str]:
    """The troubles of buses, and the frames on them that drives ignored."""
    found = {bus: [text] for bus, text in troubles.items()}
    for robot in robots:
        for side, drive in zip(("right", "left"), robot.drives, strict=True):
            if count := drive.ignored:
                text = f"{robot.brief.robot}'s {side} drive ignored {count} frames: no such command"
                found.setdefault(robot.brief.bus, []).append(f"{text}, value or length")
    return {bus: "; ".join(texts) for bus, texts in found.items()}


def divergences(robots: Iterable[EmulatedRobot], period_ns: int) -> dict[str, Event]:
    """The robots whose motion diverged, and the event, at the tick that did it."""
    return {
        robot.brief.robot: Event(
            round(found.t_s * 1e9) // period_ns, robot.brief.robot, "diverged", str(found)
        )
        for robot in robots
        if (found := robot.divergence) is not None
    }


def diverged_robots(robots: Iterable[EmulatedRobot], period_ns: int) -> dict[str, str]:
    """Robots whose motion diverged: the tick that did it, and how."""
    return {
        robot: f"{when(event.tick, period_ns)}: {event.text}"
        for robot, event in divergences(robots, period_ns).items()
    }
