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

Under a push (F along the body, T about the vertical) and with wheels that slip, i = R, L:

u_R = v + b ω,  u_L = v − b ω        speeds of the rims over ground
ν_i = u_i/ρ_i,  ρ_i = (1 − λ_i) r    λ slip ratio (r ν − u)/(r ν): the wheel turns faster       (3')
n_i = τ_i − Δ_i − d_i ν_i            torque that the wheel passes on, but for its own inertia
G_i = n_i/r if n_i ν_i > 0           it drives: the rim slides, and λ_i n_i ν_i turns to heat
      n_i/ρ_i else                   it brakes, without slipping further: power as without heat
j_i = I_w/ρ_i²,  m, I as above without I_w

(m + j_R + j_L) v' +    b (j_R − j_L) ω'      =  m_c a ω²  + G_R + G_L + F                      (4')
   b (j_R − j_L) v' + (I + b² (j_R + j_L)) ω' = −m_c a v ω + b (G_R − G_L) + T

E = (m v² + I ω² + I_w (ν_R² + ν_L²))/2 has E' = F v + T ω + Σ η_i n_i ν_i with η_i = 1 − λ_i where
a wheel drives, else 1: E' ≤ F v + T ω + Σ n_i ν_i, so slip creates no energy. Without push and slip
(4') is (4), each line divided by r²/2 and r²/(2 b²).

x, y [m]   θ [rad]   v [m/s]   ω [rad/s]   ν wheel speeds [rad/s]   τ, Δ [N·m] at the wheels
"""

from math import cos, sin
from typing import NamedTuple

from configs.brief import WheelDisturbance
from configs.sections import Body
from plant.divergence import FASTEST_WHEEL_RAD_S

NO_SLIP = (1.0, 1.0)
NO_PUSH = (0.0, 0.0)
Rolling = tuple[float, float, float, float, float, float, float, float]
"""Constants of (4)."""
Slipping = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float
]
"""Constants of (4')."""


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
    """Constants of (4), or of (4') where it slips or is pushed, for one robot.

    Args:
        rolled: 1 − λ of the (right, left) wheel, above 0.
        push: F [N] and T [N·m].
    """

    def __init__(
        self,
        body: Body,
        disturbance: WheelDisturbance,
        *,
        rolled: tuple[float, float] = NO_SLIP,
        push: tuple[float, float] = NO_PUSH,
    ) -> None:
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
        self.r, self.b = r, b
        self.inv_right, self.inv_left = 1.0 / (r * rolled[0]), 1.0 / (r * rolled[1])  # 1/ρ
        self.fastest_m_s = r * min(rolled) * FASTEST_WHEEL_RAD_S
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
        axle = body.wheel_axle_inertia_kg_m2
        self.least_inertia_wheel_kg_m2 = axle + (min(self.mbar_1, self.mbar_2) - axle) * (
            min(rolled) ** 2
        )
        """No wheel turns less than this, whatever the other one does."""
        self.rolling: Rolling = (
            *(self.c * b / self.mbar_1, self.c / b / self.mbar_2),
            *self._damping,
            *(0.5 * r / self.mbar_1, 0.5 * r / b / self.mbar_2),
        )
        self.slipping: Slipping | None = None
        """None where the body neither slips nor is pushed."""
        if rolled != NO_SLIP or push != NO_PUSH:
            load = body.body_mass_kg * a
            self.slipping = self._slipping((mass, inertia, axle, load), push)
        self.disturbed = disturbance.amplitude_wheel_N_m != 0.0
        self.disturbs: Waves = (
            disturbance.amplitude_wheel_N_m,
            disturbance.rate_rad_s,
            disturbance.phase_rad,
        )

    def wheel_speeds(self, v: float, omega: float) -> tuple[float, float]:
        """(right, left) wheel speeds ν [rad/s], equation (3) or (3')."""
        return rolling_speeds(v, omega, self.b, self.inv_right, self.inv_left)

    def wheel_torques(
        self, v: float, omega: float, v_rate: float, omega_rate: float
    ) -> tuple[float, float]:
        """(right, left) wheel torques τ − Δ [N·m] that give these accelerations: (4) inverted.

        Of a body that neither slips nor is pushed.
        """
        nu_right, nu_left = self.wheel_speeds(v, omega)
        d_right, d_left = self.damping_wheel_N_m_s
        along = self.mbar_1 * v_rate - self.c * self.b * omega * omega
        turning = self.b * (self.mbar_2 * omega_rate + self.c / self.b * v * omega)
        return (
            (along + turning) * self.inv_right + d_right * nu_right,
            (along - turning) * self.inv_left + d_left * nu_left,
        )

    def disturbance(self, t_s: float) -> tuple[float, float]:
        """Δ(t) at the (right, left) wheel [N·m]; zero before t = 0."""
        if not self.disturbed:
            return 0.0, 0.0
        return disturbance_torques(t_s, self.disturbs)

    def net(self, right: float, left: float, t_s: float) -> tuple[float, float]:
        """τ − Δ(t) at the (right, left) wheel [N·m]."""
        d_right, d_left = self.disturbance(t_s)
        return right - d_right, left - d_left

    def accelerations(
        self, v: float, omega: float, right: float, left: float
    ) -> tuple[float, float]:
        """(v', ω') under net wheel torques τ − Δ [N·m]."""
        return rates(self.rolling, self.slipping, v, omega, right, left)

    def _slipping(
        self,
        inertias: tuple[float, float, float, float],
        push: tuple[float, float],
    ) -> Slipping:
        """The constants of (4'); `inertias` are m, I, I_w and m_c a."""
        mass, inertia, axle, load = inertias
        b, inv_r, inv_right, inv_left = self.b, 1.0 / self.r, self.inv_right, self.inv_left
        j_right, j_left = axle * inv_right * inv_right, axle * inv_left * inv_left
        along, across = mass + j_right + j_left, b * (j_right - j_left)
        turning = inertia + b * b * (j_right + j_left)
        determinant = along * turning - across * across
        return (
            *(along, across, turning, determinant, load),
            *(b, inv_r, inv_right, inv_left),
            *self.damping_wheel_N_m_s,
            *push,
        )


def rolling_speeds(
    v: float, omega: float, half_track: float, inv_right: float, inv_left: float
) -> tuple[float, float]:
    """(right, left) wheel speeds ν [rad/s] by (3) or (3')."""
    turn = half_track * omega
    return (v + turn) * inv_right, (v - turn) * inv_left


Waves = tuple[float, float, float]
"""Amplitude [N·m], rate [rad/s] and phase [rad] of Δ."""


def disturbance_torques(t_s: float, waves: Waves) -> tuple[float, float]:
    """Δ(t) at the (right, left) wheel [N·m]; zero before t = 0."""
    if t_s < 0.0:
        return 0.0, 0.0
    amplitude, rate, phase = waves
    angle = rate * t_s + phase
    return amplitude * sin(angle), amplitude * cos(angle)


def rates(
    rolling: Rolling, slipping: Slipping | None, v: float, omega: float, right: float, left: float
) -> tuple[float, float]:
    """(v', ω') of a body under net wheel torques τ − Δ [N·m]."""
    if slipping is not None:
        return slipping_rates(slipping, v, omega, right, left)
    return rolling_rates(rolling, v, omega, right, left)


def rolling_rates(
    rolling: Rolling, v: float, omega: float, right: float, left: float
) -> tuple[float, float]:
    """(v', ω') of (4) under net wheel torques [N·m]."""
    centrifugal, coriolis, d11, d12, d21, d22, g1, g2 = rolling
    return (
        centrifugal * omega * omega - d11 * v - d12 * omega + g1 * (right + left),
        -coriolis * v * omega - d21 * v - d22 * omega + g2 * (right - left),
    )


def slipping_rates(
    slipping: Slipping, v: float, omega: float, right: float, left: float
) -> tuple[float, float]:
    """(v', ω') of (4') under net wheel torques [N·m]."""
    along, across, turning, determinant, load, b, inv_r, inv_right, inv_left = slipping[:9]
    d_right, d_left, force, torque = slipping[9:]
    nu_right, nu_left = (v + b * omega) * inv_right, (v - b * omega) * inv_left
    net_right, net_left = right - d_right * nu_right, left - d_left * nu_left
    drive_right = net_right * (inv_r if net_right * nu_right > 0.0 else inv_right)
    drive_left = net_left * (inv_r if net_left * nu_left > 0.0 else inv_left)
    f = load * omega * omega + drive_right + drive_left + force
    t = b * (drive_right - drive_left) - load * v * omega + torque
    return (turning * f - across * t) / determinant, (along * t - across * f) / determinant
