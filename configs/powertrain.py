"""Sections [motor], [encoder], [supply]: the powertrain of the preset "realistic".

The defaults are those of a small hub motor on an ODrive. Its rated torque is half of the largest:
at half the current limit the windings settle 75 K above ambient, where derating begins.
"""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from configs.parameters import (
    NotNegative,
    Parameters,
    Positive,
    Seconds,
    SecondsOrZero,
    parameter,
)

AboveZeroKelvin = Annotated[float, Gt(-273.15)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor(Parameters):
    """The motors with their power stages, one per wheel; torques at the motor's shaft."""

    torque_constant_N_m_A: Positive | None = parameter(
        None, "of the motor; the drive's, drive.torque_constant_N_m_A, if not given"
    )
    current_limit_A: Positive | None = parameter(
        None, "of the power stage; the drive's, drive.current_limit_A, if not given"
    )
    current_loop_s: Seconds = parameter(0.001, "time constant of the current loop")
    compute_delay_s: SecondsOrZero = parameter(0.000_125, "from demand to current loop")
    winding_resistance_ohm: Positive = parameter(
        0.2, "the heat is R i²: 1.5 times the phase resistance for amplitudes"
    )
    fet_resistance_ohm: NotNegative = parameter(0.02, "of the power stage, same sense")
    viscous_friction_shaft_N_m_s: NotNegative = 2e-4
    coulomb_friction_shaft_N_m: NotNegative = 5e-3
    ambient_C: AboveZeroKelvin = 25.0
    motor_thermal_resistance_K_W: NotNegative = parameter(15.0, "windings to ambient")
    motor_thermal_time_s: Seconds = 60.0
    fet_thermal_resistance_K_W: NotNegative = parameter(30.0, "FETs to ambient")
    fet_thermal_time_s: Seconds = 60.0
    torque_noise_shaft_N_m: NotNegative = parameter(1e-3, "rms, of the drive's estimate")
    current_quantum_A: NotNegative = parameter(0.01, "of the drive's measurement; 0: none")


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoder(Parameters):
    """The encoders, one on each motor's shaft, and the drives' velocity estimators."""

    counts_per_shaft_rev: Annotated[int, Ge(4), Le(1 << 24)] = 8192
    index: bool = parameter(False, "a mark each turn, at which lost counts are found again")
    noise_counts: Annotated[float, Ge(0), Le(1e6)] = parameter(
        0.0, "rms, of the angle before it is counted"
    )
    pll_bandwidth_rad_s: Annotated[float, Ge(1), Le(1e6)] = 1000.0
    pll_rate_Hz: Annotated[float, Ge(100), Le(100_000)] = parameter(
        8000.0, "rate of the drive's control loop"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Supply(Parameters):
    """The source of one robot, which feeds both drives."""

    voltage_V: Annotated[float, Gt(0), Le(1000)] = parameter(24.0, "open circuit")
    resistance_ohm: NotNegative = 0.1
    absorbs: bool = parameter(
        True, "True: a battery; False: braking charges the bus capacitor instead"
    )
    capacitance_F: Positive = parameter(1e-3, "of the bus, both drives together")
    standby_W: NotNegative = parameter(1.0, "of each drive's electronics")
