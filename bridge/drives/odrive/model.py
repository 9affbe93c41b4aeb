"""The section of a scenario as an emulated axis obeys it."""

from dataclasses import dataclass
from typing import Self

from bridge.drives.odrive.section import OdriveSection
from configs.brief import DriveModel
from configs.parameters import extended


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisModel(OdriveSection):
    """Values of one axis; the limits are those of the preset.

    Values that no file sets are the vendor's defaults [firmware 0.5.6 source].
    """

    torque_limiters: bool  # False: torque reaches the wheel as commanded (ideal drive)
    firmware_version: tuple[int, int, int] = (0, 6, 10)
    heartbeat_period_ns: int
    encoder_period_ns: int
    torques_period_ns: int = 0  # cyclic messages, this and the next five; 0: only on request
    error_period_ns: int = 0
    iq_period_ns: int = 0
    temperature_period_ns: int = 0
    bus_voltage_period_ns: int = 0
    powers_period_ns: int = 0
    watchdog_ns: int  # 0: off
    boot_ns: int = 0  # silent for so long after a reboot
    calibration_ns: int = 2_000_000_000  # each of motor and encoder
    velocity_ramp_shaft_rev_s2: float = 1.0
    torque_ramp_shaft_N_m_s: float = 0.01
    input_filter_bandwidth_1_s: float = 2.0
    trajectory_velocity_shaft_rev_s: float = 2.0
    trajectory_accel_shaft_rev_s2: float = 0.5
    trajectory_decel_shaft_rev_s2: float = 0.5
    current_margin_A: float = 8.0  # above the limit in force, then it disarms

    @classmethod
    def of(cls, model: DriveModel) -> Self:
        """The axes of a robot."""
        section = section_of(model.section)
        velocity_limit, current_limit_A = section.limits(limited=model.limited)
        return extended(
            cls,
            section,
            velocity_limit_shaft_rev_s=velocity_limit,
            current_limit_A=current_limit_A,
            torque_limiters=model.limited,
            firmware_version=tuple(int(part) for part in section.firmware.split(".")),
            heartbeat_period_ns=_ns(section.heartbeat_period_s),
            encoder_period_ns=model.encoder_period_ns,
            torques_period_ns=_ns(section.torques_period_s),
            error_period_ns=_ns(section.error_period_s),
            iq_period_ns=_ns(section.iq_period_s),
            temperature_period_ns=_ns(section.temperature_period_s),
            bus_voltage_period_ns=_ns(section.bus_voltage_period_s),
            powers_period_ns=_ns(section.powers_period_s),
            watchdog_ns=_ns(section.watchdog_s),
            boot_ns=_ns(section.boot_s),
            calibration_ns=_ns(section.calibration_s),
        )


def section_of(section: object) -> OdriveSection:
    """The section of a brief.

    Raises:
        TypeError: it is another protocol's.
    """
    if not isinstance(section, OdriveSection):
        raise TypeError(f"{type(section).__name__} is no section of ODrives")
    return section


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
