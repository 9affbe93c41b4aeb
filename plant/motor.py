"""The motor behind a drive: the torque at its shaft for the drive's demand.

    i* = τ*/k_d, held to ±i_max and to what the bus voltage allows                              (1)
    T di/dt = i*(t − d) − i                        current loop, exact for a held demand        (2)
    τ_m = k i,   P = τ_m ν + (R + R_f) i²          torque and electrical power                  (3)
    |R i* + k ν| ≤ (√3/2) V                        space-vector modulation of the bus voltage   (4)
    T_th dθ/dt = θ_a + R_th R i² − θ               temperature of windings, and of FETs         (5)
    τ = τ_m − b ν⁺ − F sgn(ν⁺)                     at the shaft; ν⁺: speed after the step       (6)

    τ* demand [N·m]   k, k_d torque constant: the motor's, and the one set in the drive [N·m/A]
    i  q-axis current [A]   T loop time constant, d compute delay [s]   ν shaft speed [rad/s]
    V  bus voltage [V]   R, R_f winding and FET resistance [ohm], such that R i² is the heat (1.5
    times the phase resistance where currents are amplitudes)   R_th [K/W]   θ, θ_a ambient [°C]
    b  viscous [N·m·s/rad], F Coulomb friction [N·m]

Friction is discretised implicitly: (6) is solved for ν⁺ of a shaft with inertia J, so sgn(0) takes
whatever value in [−1, 1] holds the shaft. It sticks, neither reverses the shaft nor chatters, and
never adds energy, at any step, as long as J isn't above the inertia that the body has in truth,
seen at the shaft: give min(m̄_1, m̄_2) / gear ratio². Source: R. Kikuuwe, N. Takesue, A. Sano,
H. Mochiyama, H. Fujimoto, Admittance and impedance representations of friction based on implicit
Euler integration, IEEE Transactions on Robotics 22(6), 2006.

Under effects of faults (`plant.effects`), together with what the motor does else:

    effect               current                              shaft
    torque_stuck         i* of the moment at which it began   k i
    torque_zero          i* = 0, whatever else                0
    torque_factor        by (2)                               factor × k i, back-EMF likewise
    fet_rise_K           θ_FET measured, with the rise        as without
    motor_rise_K         θ measured, with the rise            as without

A demand or speed that isn't finite acts as the largest one, NaN as 0: what comes out is finite.
"""

from math import exp, expm1, inf, sqrt
from random import Random
from typing import Final

from configs.brief import MotorModel
from plant.effects import WheelEffects
from plant.supply import Supply

_MODULATION: Final = sqrt(3.0) / 2.0
FASTEST_SHAFT_RAD_S: Final = 1e12
"""Behind the largest gear ratio, 10⁶, of a wheel at `plant.divergence.FASTEST_WHEEL_RAD_S`."""


class Motor:
    """One motor on the bus of its robot.

    `inertia_shaft_kg_m2` is J of (6): the least inertia that the body shows to its motors.
    """

    __slots__ = (
        "_acting_A",
        "_asked_A",
        "_assumed_constant",
        "_constant",
        "_coulomb",
        "_decay",
        "_dt_s",
        "_fet_K",
        "_fet_K_A2",
        "_fet_keep",
        "_fet_zero_C",
        "_inertia",
        "_inertia_rate",
        "_limit_A",
        "_loop_s",
        "_mean",
        "_mean_square",
        "_model",
        "_motor_zero_C",
        "_override_A",
        "_pending",
        "_random",
        "_resistance",
        "_stuck_A",
        "_supply",
        "_viscous",
        "_winding_K",
        "_winding_K_A2",
        "_winding_keep",
        "_winding_ohm",
        "current_A",
        "fet_C",
        "motor_C",
        "power_W",
        "torque_shaft_N_m",
    )

    def __init__(
        self, model: MotorModel, inertia_shaft_kg_m2: float, supply: Supply, random: Random
    ) -> None:
        self._model = model
        self._inertia = inertia_shaft_kg_m2
        self._supply = supply
        self._random = random
        self._assumed_constant = model.assumed_torque_constant_N_m_A
        self._limit_A = model.current_limit_A
        self._loop_s = model.current_loop_s
        self._coulomb = model.coulomb_friction_shaft_N_m
        self._viscous = model.viscous_friction_shaft_N_m_s
        self._winding_ohm = model.winding_resistance_ohm
        self._constant = model.torque_constant_N_m_A
        self._resistance = model.winding_resistance_ohm + model.fet_resistance_ohm
        self._override_A: float | None = None  # of i*, by a fault
        self._stuck_A: float | None = None
        self._asked_A = self._acting_A = 0.0
        self._pending: list[tuple[float, float]] = []  # seconds from now, current from then on
        self._dt_s = 0.0
        self._fet_K = self._winding_K = 0.0  # above ambient
        self._fet_zero_C = self._motor_zero_C = model.ambient_C  # with what faults add
        self.current_A = 0.0
        """q-axis current at the end of the last step."""
        self.torque_shaft_N_m = 0.0
        """τ_m, mean of the last step: what the motor made, before friction."""
        self.power_W = 0.0
        """P of (3), mean of the last step; negative while it feeds the bus."""
        self.fet_C = self.motor_C = model.ambient_C
        """The readings of the thermistors."""

    def step(self, demand_shaft_N_m: float, speed_shaft_rad_s: float, dt_s: float) -> float:
        """Mean torque at the shaft [N·m] over `dt_s`, for a demand and a speed at its start."""
        if dt_s != self._dt_s:
            self._discretise(dt_s)
        if not -FASTEST_SHAFT_RAD_S <= speed_shaft_rad_s <= FASTEST_SHAFT_RAD_S:
            speed_shaft_rad_s = _clamped(speed_shaft_rad_s, FASTEST_SHAFT_RAD_S)
        asked = self._current_for(demand_shaft_N_m, speed_shaft_rad_s)
        if asked == self._asked_A and not self._pending:
            off = self.current_A - asked
            self.current_A = asked + off * self._decay
            mean = asked + off * self._mean
            square = asked * asked + off * (2.0 * asked * self._mean + off * self._mean_square)
        else:
            mean, square = self._switch(asked, dt_s)
        torque = self.torque_shaft_N_m = self._constant * mean

        self.power_W = torque * speed_shaft_rad_s + self._resistance * square
        windings = self._winding_K = (
            self._winding_K * self._winding_keep + self._winding_K_A2 * square
        )
        fets = self._fet_K = self._fet_K * self._fet_keep + self._fet_K_A2 * square
        self.motor_C = windings + self._motor_zero_C
        self.fet_C = fets + self._fet_zero_C

        coulomb, viscous = self._coulomb, self._viscous
        push = self._inertia_rate * speed_shaft_rad_s + torque
        if -coulomb <= push <= coulomb:
            return torque - push
        if push < 0.0:
            coulomb = -coulomb
        return torque - coulomb - viscous * (push - coulomb) / (self._inertia_rate + viscous)

    def measure(self) -> tuple[float, float]:
        """(torque estimate [N·m], current [A]) as the drive has them: noisy, and in steps.

        The estimate knows the current and the drive's torque constant, not the motor's. Draws one
        number from the generator, so call it at instants that don't depend on listeners.
        """
        model = self._model
        current = self.current_A
        torque = self._assumed_constant * current
        if model.torque_noise_shaft_N_m:
            torque += self._random.gauss(0.0, model.torque_noise_shaft_N_m)
        quantum = model.current_quantum_A
        return torque, quantum * round(current / quantum) if quantum else current

    def apply(self, effects: WheelEffects, inertia_shaft_kg_m2: float) -> None:
        """Let these effects act from now on, and no others; heat and current are continuous.

        The inertia is that of the body under them.
        """
        model = self._model
        self._constant = model.torque_constant_N_m_A * effects.torque_factor
        if not effects.torque_stuck:
            self._stuck_A = None
        elif self._stuck_A is None:
            self._stuck_A = self.current_A
        self._override_A = 0.0 if effects.torque_zero else self._stuck_A
        self._fet_zero_C = model.ambient_C + effects.fet_rise_K
        self._motor_zero_C = model.ambient_C + effects.motor_rise_K
        self.fet_C = self._fet_K + self._fet_zero_C
        self.motor_C = self._winding_K + self._motor_zero_C
        self._inertia = inertia_shaft_kg_m2
        if self._dt_s:
            self._inertia_rate = inertia_shaft_kg_m2 / self._dt_s

    def _discretise(self, dt_s: float) -> None:
        model = self._model
        x = dt_s / self._loop_s
        self._dt_s = dt_s
        self._decay = exp(-x)
        self._mean = -expm1(-x) / x
        self._mean_square = -expm1(-2.0 * x) / (2.0 * x)
        gain = -expm1(-dt_s / model.motor_thermal_time_s)
        self._winding_keep = 1.0 - gain
        self._winding_K_A2 = gain * model.motor_thermal_resistance_K_W * self._winding_ohm
        gain = -expm1(-dt_s / model.fet_thermal_time_s)
        self._fet_keep = 1.0 - gain
        self._fet_K_A2 = gain * model.fet_thermal_resistance_K_W * model.fet_resistance_ohm
        self._inertia_rate = self._inertia / dt_s

    def _current_for(self, demand_shaft_N_m: float, speed_shaft_rad_s: float) -> float:
        """i* of (1) and (4)."""
        limit = self._limit_A
        current = demand_shaft_N_m / self._assumed_constant
        if not -limit <= current <= limit:
            current = _clamped(current, limit)
        if self._override_A is not None:
            current = self._override_A
        resistance, back = self._winding_ohm, self._constant * speed_shaft_rad_s
        most = _MODULATION * self._supply.bus_V
        if -most <= resistance * current + back <= most:
            return current
        current = min(max(current, (-most - back) / resistance), (most - back) / resistance)
        return min(max(current, -limit), limit)

    def _switch(self, asked_A: float, dt_s: float) -> tuple[float, float]:
        """(mean i, mean i²) of a step within which the demand that acts changes, by (2)."""
        pending = self._pending
        if asked_A != self._asked_A:
            self._asked_A = asked_A
            pending.append((self._model.compute_delay_s, asked_A))
        current, acting, now = self.current_A, self._acting_A, 0.0
        charge = heat = 0.0
        later = []
        for at, following in [*pending, (dt_s, inf)]:
            if at > dt_s:
                later.append((at - dt_s, following))
                continue
            x = (at - now) / self._loop_s
            off, once, twice = current - acting, -expm1(-x), -0.5 * expm1(-2.0 * x)
            charge += acting * x + off * once
            heat += acting * acting * x + off * (2.0 * acting * once + off * twice)
            current, now = acting + off * (1.0 - once), at
            if following != inf:
                acting = following
        self.current_A, self._acting_A, self._pending = current, acting, later
        periods = dt_s / self._loop_s
        return charge / periods, heat / periods


def _clamped(value: float, limit: float) -> float:
    """A value outside ±limit brought to the nearer one, NaN to 0."""
    return limit if value > limit else -limit if value < -limit else 0.0
