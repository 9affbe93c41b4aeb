"""The rigid body of a differential-drive robot, equations (2)-(4), in body speeds ξ = (v, ω).

m   = m_c + n m_w,  n = `wheels_in_mass`: 1 as the paper prints it, 2 physically
I   = m_c a² + 2 m_w b² + I_c + 2 I_m
m11 = r²/(4b²) (m b² + I) + I_w,   m12 = r²/(4b²) (m b² − I),   c = r² m_c a / (2b)
m̄_1 = m11 + m12,  m̄_2 = m11 − m12          M̄ = diag(m̄_1, m̄_2), inertias seen at the wheels
D̄_11 = D̄_22 = (d11 + d22)/2,  D̄_12 = b (d11 − d22)/2,  D̄_21 = (d11 − d22)/(2b)

x' = v cos θ,  y' = v sin θ,  θ' = ω
m̄_1 v' =  c b ω²      − D̄_11 v − D̄_12 ω + r/2 (τ_R + τ_L − Δ_R − Δ_L)
m̄_2 ω' = −(c/b) v ω   − D̄_21 v − D̄_22 ω + r/(2b) (τ_R − τ_L − Δ_R + Δ_L)
ν_R = (v + b ω)/r,  ν_L = (v − b ω)/r                                        (3)

x, y [m]   θ [rad]   v [m/s]   ω [rad/s]   ν wheel speeds [rad/s]   τ, Δ [N·m] at the wheels
"""

from collections.abc import Callable
from math import cos, sin
from typing import Any, NamedTuple

from configs.brief import WheelDisturbance
from configs.sections import Body
from plant.divergence import FASTEST_WHEEL_RAD_S

Accelerations = Callable[[float, float, float, float], tuple[float, float]]


class State(NamedTuple):
    """Motion of one robot; the wheel angles are what its encoders count."""

    x: float
    y: float
    theta: float
    v: float
    omega: float
    right_wheel_rad: float
    left_wheel_rad: float


class RigidBody:
    """Constants of (4) for one robot."""

    def __init__(self, body: Body, disturbance: WheelDisturbance) -> None:
        r, b, a = body.wheel_radius_m, body.half_track_m, body.com_offset_m
        mass = body.body_mass_kg + body.wheels_in_mass * body.wheel_mass_kg
        inertia = (
            body.body_mass_kg * a * a
            + 2.0 * body.wheel_mass_kg * b * b
            + body.body_inertia_kg_m2
            + 2.0 * body.wheel_diameter_inertia_kg_m2
        )
        scale = r * r / (4.0 * b * b)
        m11 = scale * (mass * b * b + inertia) + body.wheel_axle_inertia_kg_m2
        m12 = scale * (mass * b * b - inertia)
        self.r, self.b, self.inv_r = r, b, 1.0 / r
        self.fastest_m_s = r * FASTEST_WHEEL_RAD_S
        """No wheel's rim moves faster."""
        self.c = r * r * body.body_mass_kg * a / (2.0 * b)
        self.mbar_1, self.mbar_2 = m11 + m12, m11 - m12
        self.damping_wheel_N_m_s = right, left = (
            body.damping_right_wheel_N_m_s,
            body.damping_left_wheel_N_m_s,
        )
        self._damping = (
            0.5 * (right + left) / self.mbar_1,
            0.5 * b * (right - left) / self.mbar_1,
            0.5 * (right - left) / b / self.mbar_2,
            0.5 * (right + left) / self.mbar_2,
        )
        self.accelerations = self._equations()
        """(v, ω, right, left) ↦ (v', ω') under net wheel torques τ − Δ [N·m]."""
        self.disturbed = disturbance.amplitude_wheel_N_m != 0.0
        self._amplitude = disturbance.amplitude_wheel_N_m
        self._rate, self._phase = disturbance.rate_rad_s, disturbance.phase_rad

    def wheel_speeds(self, v: Any, omega: Any) -> tuple[Any, Any]:
        """(right, left) wheel speeds ν [rad/s], equation (3)."""
        turn = self.b * omega
        return (v + turn) * self.inv_r, (v - turn) * self.inv_r

    def wheel_torques(self, v: Any, omega: Any, v_rate: Any, omega_rate: Any) -> tuple[Any, Any]:
        """(right, left) wheel torques τ − Δ [N·m] that give these accelerations: (4) inverted.

        Of numbers, or of arrays of them.
        """
        nu_right, nu_left = self.wheel_speeds(v, omega)
        d_right, d_left = self.damping_wheel_N_m_s
        along = self.mbar_1 * v_rate - self.c * self.b * omega * omega
        turning = self.b * (self.mbar_2 * omega_rate + self.c / self.b * v * omega)
        return (
            (along + turning) * self.inv_r + d_right * nu_right,
            (along - turning) * self.inv_r + d_left * nu_left,
        )

    def disturbance(self, t_s: float) -> tuple[float, float]:
        """Δ(t) at the (right, left) wheel [N·m]; zero before t = 0."""
        if not self.disturbed or t_s < 0.0:
            return 0.0, 0.0
        angle = self._rate * t_s + self._phase
        return self._amplitude * sin(angle), self._amplitude * cos(angle)

    def net(self, right: float, left: float, t_s: float) -> tuple[float, float]:
        """τ − Δ(t) at the (right, left) wheel [N·m]."""
        d_right, d_left = self.disturbance(t_s)
        return right - d_right, left - d_left

    def _equations(self) -> Accelerations:
        """(v', ω') of (4), its constants bound once."""
        centrifugal, coriolis = self.c * self.b / self.mbar_1, self.c / self.b / self.mbar_2
        d11, d12, d21, d22 = self._damping
        g1 = 0.5 * self.r / self.mbar_1
        g2 = 0.5 * self.r / self.b / self.mbar_2

        def accelerations(v: float, omega: float, right: float, left: float) -> tuple[float, float]:
            return (
                centrifugal * omega * omega - d11 * v - d12 * omega + g1 * (right + left),
                -coriolis * v * omega - d21 * v - d22 * omega + g2 * (right - left),
            )

        return accelerations
