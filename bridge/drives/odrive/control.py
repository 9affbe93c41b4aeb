"""The cascade of an axis: position P, velocity PI, torque; and how inputs become set-points.

    v* = v_s + k_p (x_s − x)                        position mode; v* = v_s in velocity mode    (1)
    v* held to ±v_max                                                                           (2)
    τ = τ_s + k_v (v* − v) + z,   dz/dt = k_i (v* − v)       z decays while τ is limited        (3)
                                                             and is held to ±z_max
    τ held to (±v_max − v) k_v                      torque mode only                            (4)
    τ held to ±τ_max                                                                            (5)

    input mode     x_s, v_s, τ_s
    INACTIVE       stay
    PASSTHROUGH    the inputs
    VEL_RAMP       v_s moves to its input by at most a ramp, τ_s = inertia × its rate
    POS_FILTER     dv_s/dt = ω² (x_in − x_s) + 2 ω (v_in − v_s), τ_s = inertia × that
    TRAP_TRAJ      those of `trapezoid`, τ_s = inertia × acceleration
    TORQUE_RAMP    τ_s moves to its input by at most a ramp

    x [rev]   v [rev/s]   τ, z [N·m]   k_p [1/s]   k_v [N·m·s/rev]   k_i [N·m/rev]   ω [1/s]

Source: ODrive firmware 0.5.6, controller.cpp; its gains and limits are `parameters`. Other modes
don't exist here: `exists` says so and the axis disarms. (2), (4), (5) aren't there in an ideal
drive.
"""

from typing import Final

from bridge.drives.odrive.frames import ControlMode, InputMode
from bridge.drives.odrive.parameters import Parameters
from bridge.drives.odrive.trapezoid import Trapezoid, plan

_TORQUE: Final = int(ControlMode.TORQUE)
_POSITION: Final = int(ControlMode.POSITION)
_PASSTHROUGH: Final = int(InputMode.PASSTHROUGH)
_LOOP_HZ: Final = 8000.0
_INTEGRATOR_KEEP: Final = 0.99
"""Factor on z per loop period while τ is limited."""
_CONTROL_MODES: Final = frozenset((ControlMode.TORQUE, ControlMode.VELOCITY, ControlMode.POSITION))
_INPUT_MODES: Final = frozenset(InputMode) - {InputMode.MIRROR, InputMode.TUNING}


def exists(control_mode: int, input_mode: int) -> bool:
    """Whether the axis can run in these modes."""
    return control_mode in _CONTROL_MODES and input_mode in _INPUT_MODES


class Controller:
    """Set-points and integrator of one axis."""

    __slots__ = (
        "_goal",
        "_integral",
        "_parameters",
        "_trajectory",
        "_trajectory_s",
        "input_position",
        "input_velocity",
        "position_setpoint",
        "torque_setpoint",
        "trajectory_done",
        "velocity_setpoint",
    )

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.input_position = self.input_velocity = 0.0
        self.trajectory_done = True
        self.reset(0.0)

    def reset(self, position: float) -> None:
        """Begin where the axis is, as arming does; velocity and torque inputs stay."""
        self.position_setpoint = position
        if self._parameters.control_mode == ControlMode.POSITION:
            self.input_position = position
        self.velocity_setpoint = self.torque_setpoint = self._integral = 0.0
        self._goal: float | None = None
        self._trajectory: Trapezoid | None = None
        self._trajectory_s = 0.0

    def move_to(self, position: float) -> None:
        """Set the position input; TRAP_TRAJ plans a move to it."""
        self.input_position = position
        if self._parameters.input_mode == InputMode.TRAP_TRAJ:
            self._goal = position
            self.trajectory_done = False

    def step(
        self,
        dt_s: float,
        input_torque: float,
        motion: tuple[float, float],
        torque_limit: float | None,
    ) -> float:
        """Advance by `dt_s`; torque [N·m] by (1)-(5). `torque_limit` None: an ideal drive."""
        p = self._parameters
        mode = p.control_mode
        self._follow_inputs(dt_s, input_torque)
        torque = self.torque_setpoint
        velocity = motion[1]
        limited = torque_limit is not None
        error = 0.0
        if mode != _TORQUE:
            wanted = self.velocity_setpoint
            if mode == _POSITION:
                wanted += p.position_gain * (self.position_setpoint - motion[0])
            if limited:
                wanted = min(max(wanted, -p.velocity_limit), p.velocity_limit)
            error = wanted - velocity
            torque += p.velocity_gain * error + self._integral
        elif limited:
            torque = min(torque, (p.velocity_limit - velocity) * p.velocity_gain)
            torque = max(torque, (-p.velocity_limit - velocity) * p.velocity_gain)
        unlimited = torque
        if torque_limit is not None:
            torque = min(max(torque, -torque_limit), torque_limit)
        if mode == _TORQUE:
            self._integral = 0.0
        elif torque != unlimited:
            self._decay(dt_s, self._integral + torque - unlimited)
        else:
            most = p.velocity_integrator_limit
            integral = self._integral + p.velocity_integrator_gain * error * dt_s
            self._integral = min(max(integral, -most), most)
        return torque

    def _decay(self, dt_s: float, edge: float) -> None:
        """Let the integral decay, but not past the edge from where on nothing limits any more."""
        before = self._integral
        after = before * _INTEGRATOR_KEEP ** (dt_s * _LOOP_HZ)
        self._integral = edge if (before - edge) * (after - edge) < 0.0 else after

    def _follow_inputs(self, dt_s: float, input_torque: float) -> None:
        p = self._parameters
        mode = p.input_mode
        if mode == _PASSTHROUGH:
            self.position_setpoint = self.input_position
            self.velocity_setpoint = self.input_velocity
            self.torque_setpoint = input_torque
        elif dt_s <= 0.0:
            return
        elif mode == InputMode.VEL_RAMP:
            most = p.velocity_ramp * dt_s
            step = min(max(self.input_velocity - self.velocity_setpoint, -most), most)
            self.velocity_setpoint += step
            self.torque_setpoint = step / dt_s * p.inertia
        elif mode == InputMode.TORQUE_RAMP:
            most = p.torque_ramp * dt_s
            self.torque_setpoint += min(max(input_torque - self.torque_setpoint, -most), most)
        elif mode == InputMode.POS_FILTER:
            bandwidth = min(p.filter_bandwidth, 0.25 / dt_s)
            accel = bandwidth * bandwidth * (self.input_position - self.position_setpoint)
            accel += 2.0 * bandwidth * (self.input_velocity - self.velocity_setpoint)
            self.torque_setpoint = accel * p.inertia
            self.velocity_setpoint += dt_s * accel
            self.position_setpoint += dt_s * self.velocity_setpoint
        elif mode == InputMode.TRAP_TRAJ:
            self._follow_trajectory(dt_s)

    def _follow_trajectory(self, dt_s: float) -> None:
        p = self._parameters
        if self._goal is not None:
            limits = p.trajectory_velocity, p.trajectory_accel, p.trajectory_decel
            self._trajectory = plan(
                self.position_setpoint, self.velocity_setpoint, self._goal, limits
            )
            self._goal, self._trajectory_s = None, 0.0
        trajectory = self._trajectory
        if trajectory is None:
            return
        self._trajectory_s += dt_s
        self.position_setpoint, self.velocity_setpoint, accel = trajectory.point_at(
            self._trajectory_s
        )
        self.torque_setpoint = accel * p.inertia
        if self._trajectory_s >= trajectory.duration_s:
            self._trajectory = None
            self.trajectory_done = True
