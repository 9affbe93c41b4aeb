"""Sections [motor], [encoder], [supply]: what the preset "realistic" puts behind the drives.

The defaults are those of a small hub motor on an ODrive. Its rated torque is half of the largest:
at half the current limit the windings settle 75 K above ambient, where derating begins.
"""

from typing import Annotated

from pydantic import Field

from configs.sections import NotNegative, Positive, Seconds, SecondsOrZero, Section

AboveZeroKelvin = Annotated[float, Field(gt=-273.15, allow_inf_nan=False)]


class Motor(Section):
    """The motors with their power stages, one per wheel; torques at the motor's shaft."""

    torque_constant_N_m_A: Positive | None = Field(
        None, description="of the motor; the drive's, drive.torque_constant_N_m_A, if not given"
    )
    current_limit_A: Positive | None = Field(
        None, description="of the power stage; the drive's, drive.current_limit_A, if not given"
    )
    current_loop_s: Seconds = Field(0.001, description="time constant of the current loop")
    compute_delay_s: SecondsOrZero = Field(0.000_125, description="from demand to current loop")
    winding_resistance_ohm: Positive = Field(
        0.2, description="the heat is R i²: 1.5 times the phase resistance for amplitudes"
    )
    fet_resistance_ohm: NotNegative = Field(0.02, description="of the power stage, same sense")
    viscous_friction_shaft_N_m_s: NotNegative = 2e-4
    coulomb_friction_shaft_N_m: NotNegative = 5e-3
    ambient_C: AboveZeroKelvin = 25.0
    motor_thermal_resistance_K_W: NotNegative = Field(15.0, description="windings to ambient")
    motor_thermal_time_s: Seconds = 60.0
    fet_thermal_resistance_K_W: NotNegative = Field(30.0, description="FETs to ambient")
    fet_thermal_time_s: Seconds = 60.0
    torque_noise_shaft_N_m: NotNegative = Field(1e-3, description="rms, of the drive's estimate")
    current_quantum_A: NotNegative = Field(0.01, description="of the drive's measurement; 0: none")


class Encoder(Section):
    """The encoders, one on each motor's shaft, and the drives' velocity estimators."""

    counts_per_shaft_rev: Annotated[int, Field(ge=4, le=1 << 24)] = 8192
    index: bool = Field(False, description="a mark each turn, at which lost counts are found again")
    noise_counts: Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)] = Field(
        0.0, description="rms, of the angle before it is counted"
    )
    pll_bandwidth_rad_s: Annotated[float, Field(ge=1, le=1e6, allow_inf_nan=False)] = 1000.0
    pll_rate_Hz: Annotated[float, Field(ge=100, le=100_000, allow_inf_nan=False)] = Field(
        8000.0, description="rate of the drive's control loop"
    )


class Supply(Section):
    """The source of one robot, which feeds both drives."""

    voltage_V: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = Field(
        24.0, description="open circuit"
    )
    resistance_ohm: NotNegative = 0.1
    absorbs: bool = Field(
        True, description="True: a battery; False: braking charges the bus capacitor instead"
    )
    capacitance_F: Positive = Field(1e-3, description="of the bus, both drives together")
    standby_W: NotNegative = Field(1.0, description="of each drive's electronics")
