"""What the two backstepping baselines share: gains, errors of speed, torques, and what check asks.

    e = (v − v̄, ω − ω̄)                                                                     [3]
    u = −k_4 e − F(e', v, ω) Θ,    τ = B^-1 u                                              [4]

with the regressor F of (34), whose rates are those of the virtual controls; Θ is the design's, a
multiple of the robot's. Nothing adapts.
"""

from math import inf

from agents.laws.dsc_terms import wheel_torques
from agents.laws.fixed_dsc import scaled
from agents.laws.gains import BacksteppingGains
from agents.laws.interface import AdaptationLimit, Law, RobotMotion, Wheels


class Backstepping(Law):
    """Equations [3], [4]; a subclass brings the virtual controls and their rates."""

    def __init__(self, gains: BacksteppingGains, wheels: Wheels) -> None:
        self._wheels, self._k4 = wheels, gains.k4
        self._theta = scaled(gains.theta, gains.factor)

    def torques(
        self, motion: RobotMotion, v_bar: float, omega_bar: float, v_rate: float, omega_rate: float
    ) -> tuple[float, float, float, float]:
        """Wheel torques right and left [N·m], and the speed errors of [3]."""
        v, omega, k4, wheels = motion.v, motion.omega, self._k4, self._wheels
        e_1, e_2 = v - v_bar, omega - omega_bar  # [3]
        t1, t2, t3, t4, t5, t6, t7, t8 = self._theta
        known_1 = omega * omega * t1 - v * t2 - omega * t3 - v_rate * t4
        known_2 = -v * omega * t5 - v * t6 - omega * t7 - omega_rate * t8
        u_1, u_2 = -k4 * e_1 - known_1, -k4 * e_2 - known_2  # [4]
        right, left = wheel_torques(u_1, u_2, wheels.radius_m, wheels.half_track_m)  # (3)
        return right, left, e_1, e_2

    # --- what follows from the equations, for `fleetloop check` ---------------------------------

    SPEED_GAIN = "k4"
    LOOP_GAINS = ("k1", "k3", "k2", "k4")

    @classmethod
    def torque_limit_wheel_N_m(cls, gains: BacksteppingGains) -> float:  # noqa: ARG003
        """None: [4] asks for whatever its terms are."""
        return inf

    @classmethod
    def approach_rate_1_s(cls, gains: BacksteppingGains) -> float | None:
        """k_1 of (15)."""
        return gains.k1

    @classmethod
    def lateral_gain_1_m(cls, gains: BacksteppingGains) -> float | None:
        """k_2 of (17)."""
        return gains.k2

    @classmethod
    def speed_gain_N_m_s(cls, gains: BacksteppingGains) -> float | None:
        """k_4 of [4]."""
        return gains.k4

    @classmethod
    def adaptation_limit(
        cls,
        gains: BacksteppingGains,  # noqa: ARG003
        period_s: float,  # noqa: ARG003
    ) -> AdaptationLimit | None:
        """None: nothing adapts."""
        return None
