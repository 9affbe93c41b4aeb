"""The controller of an ODrive axis: from set-points to the torque that its motor is asked for.

    input mode     set-points p*, v*, τ*
    PASSTHROUGH    the inputs
    VEL_RAMP       v* follows the input at `vel_ramp_rate`, τ* = inertia × its rate
    TORQUE_RAMP    τ* follows the input at `torque_ramp_rate`
    POS_FILTER     p* follows the input by a critically damped filter of `input_filter_bandwidth`
    TRAP_TRAJ      p* goes to the input with the trajectory's speed and accelerations
    INACTIVE       as they are

    v_des = v* + k_p (p* − p)                     position control; within ±vel_limit
    τ = τ* + k_v (v_des − v) + ∫ k_i (v_des − v)  velocity and position control
    τ within (±vel_limit − v) k_v                 torque control: the velocity limiter
    τ within ± current limit × torque constant    always; silently

As in the vendor's firmware (0.5.6 `controller.cpp`; the cascade is the same in 0.6): while τ is
limited the integral decays. Units are turns, turns/s, N·m. Setting a velocity or a position sets
the torque too, by the message's feed-forward field, in torque control as well.

Nothing here is ever NaN: inputs that aren't finite don't come in.
"""

from math import copysign, sqrt

from bridge.drives.odrive.frames import ControlMode, InputMode
from configs.brief import DriveModel

_LOOP_HZ = 8000.0
_LIMITED_KEEP = 0.99  # of the integral, per cycle of the vendor's loop
_ARRIVED_REV = 1e-4
REFUSED_MODES = frozenset({InputMode.MIRROR, InputMode.TUNING})
"""They need another axis or a signal generator, which nobody emulates."""


class Control:
    """Set-points, modes, gains and limits of one axis."""

    __slots__ = (
        "_integral",
        "accel_limit",
        "arrived",
        "control_mode",
        "current_limit",
        "decel_limit",
        "filter_bandwidth",
        "inertia",
        "input_mode",
        "input_position",
        "input_torque",
        "input_velocity",
        "limiters",
        "plain",
        "position",
        "position_gain",
        "torque",
        "torque_constant",
        "torque_ramp_rate",
        "trajectory_velocity",
        "velocity",
        "velocity_gain",
        "velocity_integrator_gain",
        "velocity_limit",
        "velocity_ramp_rate",
    )

    def __init__(self, model: DriveModel) -> None:
        self.limiters = model.torque_limiters
        self.torque_constant = model.torque_constant_N_m_A
        self.velocity_limit = model.velocity_limit_rev_s
        self.current_limit = model.current_limit_A
        self.velocity_gain = model.velocity_gain_N_m_s_rev
        self.velocity_integrator_gain = model.velocity_integrator_gain_N_m_rev
        self.position_gain = model.position_gain_1_s
        self.velocity_ramp_rate = 1.0  # rev/s²; the vendor's defaults, as below
        self.torque_ramp_rate = 0.01  # N·m/s
        self.filter_bandwidth = 2.0  # 1/s
        self.inertia = 0.0  # N·m/(rev/s²)
        self.trajectory_velocity = 2.0  # rev/s
        self.accel_limit = self.decel_limit = 0.5  # rev/s²
        self.control_mode = ControlMode.TORQUE
        self.input_mode = InputMode.PASSTHROUGH
        self.plain = not self.limiters
        """The input torque is the answer: torque control, passed through, nothing limited."""
        self.input_position = self.input_velocity = self.input_torque = 0.0
        self.position = self.velocity = self.torque = 0.0
        self.arrived = True
        self._integral = 0.0

    def set_modes(self, control: ControlMode, mode: InputMode) -> None:
        """Change what is controlled and how inputs come in."""
        self.control_mode, self.input_mode = control, mode
        passed = control is ControlMode.TORQUE and mode is InputMode.PASSTHROUGH
        self.plain = passed and not self.limiters
        self.arrived = mode is not InputMode.TRAP_TRAJ

    def reset(self, position: float, velocity: float) -> None:
        """On arming: nothing of the last time acts, but for the inputs themselves."""
        self._integral = 0.0
        self.torque = 0.0
        self.velocity = velocity if self.input_mode is not InputMode.VEL_RAMP else 0.0
        self.position = position
        if self.control_mode is ControlMode.POSITION:
            self.input_position = position
            self.velocity = 0.0

    def demand(self, dt_s: float, position: float, velocity: float, derating: float) -> float:
        """Torque for the next `dt_s` [N·m]; `derating` is the share of the current allowed."""
        if self.plain:
            return self.input_torque
        self._set_points(dt_s)
        torque, gain, limit = self.torque, self.velocity_gain, self.velocity_limit
        mode = self.control_mode
        error = 0.0
        if mode is ControlMode.TORQUE:
            if self.limiters:
                torque = min(torque, (limit - velocity) * gain)
                torque = max(torque, (-limit - velocity) * gain)
        else:
            wanted = self.velocity
            if mode is ControlMode.POSITION:
                wanted += self.position_gain * (self.position - position)
            error = min(max(wanted, -limit), limit) - velocity
            torque += gain * error + self._integral
        if not self.limiters:
            return torque
        most = self.current_limit * derating * self.torque_constant
        limited = min(max(torque, -most), most)
        if mode is not ControlMode.TORQUE:
            self._integrate(dt_s, error, limited=limited != torque)
        return limited

    def _integrate(self, dt_s: float, error: float, *, limited: bool) -> None:
        if limited:
            self._integral *= _LIMITED_KEEP ** (dt_s * _LOOP_HZ)
        else:
            self._integral += self.velocity_integrator_gain * dt_s * error

    def _set_points(self, dt_s: float) -> None:
        match self.input_mode:
            case InputMode.PASSTHROUGH:
                self.position, self.velocity = self.input_position, self.input_velocity
                self.torque = self.input_torque
            case InputMode.VEL_RAMP:
                before = self.velocity
                step = self.velocity_ramp_rate * dt_s
                self.velocity += min(max(self.input_velocity - before, -step), step)
                rate = (self.velocity - before) / dt_s if dt_s > 0.0 else 0.0
                self.torque = rate * self.inertia
            case InputMode.TORQUE_RAMP:
                step = self.torque_ramp_rate * dt_s
                self.torque += min(max(self.input_torque - self.torque, -step), step)
            case InputMode.POS_FILTER:
                self._filter(dt_s)
            case InputMode.TRAP_TRAJ:
                self._follow_trajectory(dt_s)
            case _:
                pass

    def _filter(self, dt_s: float) -> None:
        ki = 2.0 * min(self.filter_bandwidth, 0.25 * _LOOP_HZ)
        kp = 0.25 * ki * ki
        if ki * dt_s > 0.5:  # coarser than the vendor's loop: in steps that stay stable
            for _ in range(steps := int(2.0 * ki * dt_s) + 1):
                self._filter(dt_s / steps)
            return
        away, slower = self.input_position - self.position, self.input_velocity - self.velocity
        acceleration = kp * away + ki * slower
        self.torque = acceleration * self.inertia
        self.velocity += dt_s * acceleration
        self.position += dt_s * self.velocity

    def _follow_trajectory(self, dt_s: float) -> None:
        """A trapezoid of speed, as if planned anew from here at every step."""
        away = self.input_position - self.position
        brake = sqrt(2.0 * self.decel_limit * abs(away))
        wanted = copysign(min(self.trajectory_velocity, brake), away)
        up = self.accel_limit if abs(wanted) > abs(self.velocity) else self.decel_limit
        step = up * dt_s
        before = self.velocity
        self.velocity += min(max(wanted - before, -step), step)
        move = 0.5 * (before + self.velocity) * dt_s
        if abs(away) <= max(_ARRIVED_REV, abs(move)) and abs(self.velocity) <= 2.0 * step:
            self.position, self.velocity = self.input_position, 0.0
            self.arrived = True
        else:
            self.position += move
            self.arrived = False
        rate = (self.velocity - before) / dt_s if dt_s > 0.0 else 0.0
        self.torque = rate * self.inertia
