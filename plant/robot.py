"""One emulated robot: body, and behind each wheel a drive, a motor and an encoder.

    bus frames ─► drive ─torque demand─► motor ─torque─► body ─wheel angle, speed─► encoder ─► drive

A robot is told the time and never asks for it. A step of the integration holds the torques.
Drives, motors and encoders are at the motor shaft, the body and what is recorded at the wheel:

    wheel torque = gear × shaft torque,  shaft angle = gear × wheel angle,  gear = sign × gear ratio

    EmulatedRobot     ideal motors and encoders: a drive's demand acts at once, its encoder is exact
    RealisticRobot    motors, supply and encoders of `plant.powertrain`

Effects of faults are values (`plant.effects`), taken over as a whole when they change. Without any,
nothing on the way is asked for them: what they need is made with them.
"""

from collections.abc import Sequence
from math import ceil, inf
from typing import Final

from bridge.drives.interface import DriveMeasurements, DriveNode
from bridge.drives.wrapped import node_of
from bridge.frame import Frame
from bridge.network.messages import PoseFix
from bridge.network.telemetry import PLANT_ROW, RowBuffer
from configs.brief import RobotBrief
from plant.body import RigidBody, State
from plant.divergence import Divergence
from plant.effects import RobotEffects
from plant.encoder import PER_RADIAN, Encoder
from plant.exact import ExactEncoder, ExactPowertrain, shaft_motion
from plant.integrate import Motion, moved
from plant.localisation import FaultyLocalisation
from plant.motor import Motor
from plant.powertrain import powertrain

MEASURE_EVERY_S: Final = 0.001
"""Shortest period at which a drive's firmware reads its thermistors and currents."""
_SHORTEST_STEP_S: Final = 1e-5
_STABLE: Final = 2.0
"""Friction's rate by the step: explicit steps are stable below 2.78."""


class EmulatedRobot:
    """One robot on its bus."""

    __slots__ = (
        "_answered_ns",
        "_body",
        "_demand_left_wheel_N_m",
        "_demand_right_wheel_N_m",
        "_faulty",
        "_gear_left",
        "_gear_right",
        "_left",
        "_localisation",
        "_longest_step_s",
        "_motion",
        "_right",
        "_torque_left_wheel_N_m",
        "_torque_right_wheel_N_m",
        "brief",
        "divergence",
        "drives",
        "moved_ns",
    )

    def __init__(self, brief: RobotBrief) -> None:
        self.brief = brief
        self._body = RigidBody(brief.body, brief.disturbance)
        drive, serial_number = brief.drive, brief.drive.serial_number
        self._right = node_of(drive, brief.right_node, serial_number, brief.robot)
        self._left = node_of(drive, brief.left_node, serial_number + 1, brief.robot)
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
        self._faulty: ExactPowertrain | None = None
        self._localisation: FaultyLocalisation | None = None
        self._longest_step_s = inf
        pose, speeds = brief.pose, (brief.v_m_s, brief.omega_rad_s)
        self._motion: Motion = (pose.x_m, pose.y_m, pose.theta_rad, *speeds, 0.0, 0.0)

    @property
    def state(self) -> State:
        """The motion of the body."""
        return State(*self._motion)

    @state.setter
    def state(self, state: State) -> None:
        self._motion = state

    def update_encoders(self) -> None:
        """Hand both drives the position and speed of their encoders."""
        _, _, _, v, omega, right_rad, left_rad = self._motion
        right_speed, left_speed = self._body.wheel_speeds(v, omega)
        of_right = shaft_motion(right_rad, right_speed, self._gear_right)
        of_left = shaft_motion(left_rad, left_speed, self._gear_left)
        if self._faulty is not None:
            right_encoder, left_encoder = self._faulty.encoders
            of_right, of_left = right_encoder.read(*of_right), left_encoder.read(*of_left)
        right_rev, right_rev_s = of_right
        left_rev, left_rev_s = of_left
        self._right.update_encoder(right_rev, right_rev_s)
        self._left.update_encoder(left_rev, left_rev_s)

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
        frames = list(self._right.due(now_ns))
        frames += self._left.due(now_ns)
        if len(frames) > 1:
            frames.sort()
        return frames

    def on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Give one frame from the bus to the drives that it may concern; return their replies."""
        can_id, right, left = frame.can_id, self._right, self._left
        if can_id == right.setpoint_id != left.setpoint_id:
            return right.on_frame(frame, now_ns)
        if can_id == left.setpoint_id != right.setpoint_id:
            return left.on_frame(frame, now_ns)
        replies = right.on_frame(frame, now_ns), left.on_frame(frame, now_ns)
        return [*replies[0], *replies[1]] if any(replies) else ()

    def advance(self, t_s: float, period_s: float, substeps: int) -> None:
        """Integrate one control period from scenario time `t_s`, torques held."""
        right = self._right.torque_demand_shaft(period_s) * self._gear_right
        left = self._left.torque_demand_shaft(period_s) * self._gear_left
        self._demand_right_wheel_N_m, self._demand_left_wheel_N_m = right, left
        if self._faulty is not None:
            right, left = self._faulty.torques(right, left)
        self._torque_right_wheel_N_m, self._torque_left_wheel_N_m = right, left
        if self.divergence is not None:
            return
        step = period_s / substeps
        if step > self._longest_step_s:
            substeps, step = self._stable_steps(period_s)
        body, motion = self._body, self._motion
        try:
            for n in range(substeps):
                motion = moved(body, motion, right, left, t_s + n * step, step)
        except ValueError:
            motion = self._stop(t_s, motion, right, left)
        self._motion = motion

    # --- faults ------------------------------------------------------------------------------

    def apply(self, effects: RobotEffects) -> None:
        """Let these effects act from now on, and no others; what former ones did stays done.

        Speeds of the body are continuous, and so are poses, counts and charges.
        """
        brief = self.brief
        self._body = body = RigidBody(
            effects.loaded(brief.body),
            brief.disturbance,
            rolled=effects.rolled,
            push=(effects.force_body_N, effects.torque_body_N_m),
        )
        fastest = max(body.damping_wheel_N_m_s) / body.least_inertia_wheel_kg_m2
        self._longest_step_s = max(_STABLE / fastest, _SHORTEST_STEP_S) if fastest else inf
        if self._localisation is None and effects.of_poses:
            self._localisation = FaultyLocalisation()
        if self._localisation is not None:
            self._localisation.apply(effects)
        self._apply_to_powertrain(effects)

    def _stable_steps(self, span_s: float) -> tuple[int, float]:
        """The least number of steps in a span at which they are stable, and their length [s]."""
        steps = ceil(span_s / self._longest_step_s)
        return steps, span_s / steps

    def _apply_to_powertrain(self, effects: RobotEffects) -> None:
        if self._faulty or effects.right.of_powertrain or effects.left.of_powertrain:
            torques = self._torque_right_wheel_N_m, self._torque_left_wheel_N_m
            self._exact_powertrain().apply(effects, torques, self._shafts_rev())

    def _exact_powertrain(self) -> ExactPowertrain:
        if self._faulty is None:
            self._faulty = ExactPowertrain(self.brief.powertrain, self._shafts_rev())
        return self._faulty

    def _shafts_rev(self) -> tuple[float, float]:
        """Angle of the (right, left) shaft [rev]."""
        right, left = PER_RADIAN * self._gear_right, PER_RADIAN * self._gear_left
        _, _, _, _, _, right_rad, left_rad = self._motion
        return right_rad * right, left_rad * left

    @property
    def encoders(self) -> tuple[Encoder | ExactEncoder, Encoder | ExactEncoder]:
        """The (right, left) encoder, for its count to jump."""
        return self._exact_powertrain().encoders

    def jump_pose(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Let the next pose alone be off by this."""
        if self._localisation is None:
            self._localisation = FaultyLocalisation()
        self._localisation.jump(x_m, y_m, theta_rad)

    # --- motion ------------------------------------------------------------------------------

    def pose_fix(self, tick: int, t_ns: int) -> PoseFix:
        """The pose as the localisation system sees it now."""
        x, y, theta, _, _, _, _ = self._motion
        fix = PoseFix(tick, t_ns, x, y, theta)
        return fix if self._localisation is None else self._localisation.seen(fix)

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

    def _stop(
        self, t_s: float, sound: Motion, right_wheel_N_m: float, left_wheel_N_m: float
    ) -> Motion:
        """The motion diverged: at rest where it was sound at last, under these torques."""
        x, y, theta, v, omega, right_rad, left_rad = sound
        self.divergence = Divergence(t_s, v, omega, right_wheel_N_m, left_wheel_N_m)
        self._right.lose_estimate()
        self._left.lose_estimate()
        return x, y, theta, 0.0, 0.0, right_rad, left_rad

    def record(self, rows: RowBuffer, tick: int, t_s: float) -> None:
        """Add the signals of `configs.signals.PLANT_SIGNALS` at this instant to the record."""
        x, y, theta, v, omega, _, _ = self._motion
        rows.begin(tick)
        rows.put(t_s)
        rows.put(x)
        rows.put(y)
        rows.put(theta)
        rows.put(v)
        rows.put(omega)
        rows.put(self._right.input_torque_shaft * self._gear_right)
        rows.put(self._left.input_torque_shaft * self._gear_left)
        rows.put(self._demand_right_wheel_N_m)
        rows.put(self._demand_left_wheel_N_m)
        rows.put(self._torque_right_wheel_N_m)
        rows.put(self._torque_left_wheel_N_m)
        rows.end()

    def row(self, t_s: float) -> tuple[float, ...]:
        """The same signals, for who wants to see them."""
        rows = RowBuffer(PLANT_ROW, _nobody)
        self.record(rows, 0, t_s)
        return rows.newest


class RealisticRobot(EmulatedRobot):
    """One robot with real motors, supply and encoders."""

    __slots__ = ("_train", "_unmeasured_s")

    def __init__(self, brief: RobotBrief) -> None:
        super().__init__(brief)
        self._train = powertrain(brief.powertrain, self._shaft_inertia())
        self._unmeasured_s = 0.0

    def _shaft_inertia(self) -> float:
        """The least inertia that a motor turns, at its shaft [kg·m²]."""
        gear_ratio = self.brief.mounting.gear_ratio
        return self._body.least_inertia_wheel_kg_m2 / (gear_ratio * gear_ratio)

    def _apply_to_powertrain(self, effects: RobotEffects) -> None:
        train, inertia = self._train, self._shaft_inertia()
        train.supply.apply(effects.supply_V)
        train.right_motor.apply(effects.right, inertia)
        train.left_motor.apply(effects.left, inertia)
        train.right_encoder.apply(effects.right)
        train.left_encoder.apply(effects.left)

    @property
    def encoders(self) -> tuple[Encoder | ExactEncoder, Encoder | ExactEncoder]:
        """The (right, left) encoder, for its count to jump."""
        return self._train.right_encoder, self._train.left_encoder

    def update_encoders(self) -> None:
        """The encoders have told their drives already, at every step."""

    def advance(self, t_s: float, period_s: float, substeps: int) -> None:
        """Integrate one span from scenario time `t_s`; drives, motors and encoders step with it."""
        step = period_s / substeps
        if step > self._longest_step_s:
            substeps, step = self._stable_steps(period_s)
        motion, body, train = self._motion, self._body, self._train
        right, left = self._right, self._left
        gear_r, gear_l = self._gear_right, self._gear_left
        demands = torques = (0.0, 0.0)
        for n in range(substeps):
            demands = right.torque_demand_shaft(step), left.torque_demand_shaft(step)
            _, _, _, v, omega, _, _ = motion
            right_speed, left_speed = body.wheel_speeds(v, omega)
            shafts = train.step(demands, (right_speed * gear_r, left_speed * gear_l), step)
            right_wheel_N_m, left_wheel_N_m = shafts[0] * gear_r, shafts[1] * gear_l
            torques = right_wheel_N_m, left_wheel_N_m
            if self.divergence is None:
                try:
                    motion = moved(
                        body, motion, right_wheel_N_m, left_wheel_N_m, t_s + n * step, step
                    )
                except ValueError:
                    motion = self._stop(t_s, motion, right_wheel_N_m, left_wheel_N_m)
            _, _, _, _, _, right_rad, left_rad = motion
            rev, rev_s = train.right_encoder.step(right_rad * gear_r, step)
            right.update_encoder(rev, rev_s)
            rev, rev_s = train.left_encoder.step(left_rad * gear_l, step)
            left.update_encoder(rev, rev_s)
        self._motion = motion
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
        bus_V, right_A, left_A = train.supply.bus_V, train.supply.right_A, train.supply.left_A
        self._right.update_measurements(_measured(train.right_motor, bus_V, right_A))
        self._left.update_measurements(_measured(train.left_motor, bus_V, left_A))


def _measured(motor: Motor, bus_V: float, bus_A: float) -> DriveMeasurements:
    torque, current = motor.measure()
    return DriveMeasurements(torque, current, motor.fet_C, motor.motor_C, bus_V, bus_A)


def _nobody(_first: int, _count: int, _rows: bytes, _final: bool) -> None:
    """Takes no blocks."""


def emulated_robot(brief: RobotBrief) -> EmulatedRobot:
    """The emulation of a robot as its brief wants it."""
    return EmulatedRobot(brief) if brief.ideal_powertrain else RealisticRobot(brief)
