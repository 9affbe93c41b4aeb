"""The motor behind a drive: what torque the wheel feels for what the drive asks of it.

The ideal motor makes what it is asked for at once. Current loop, friction and heating belong here.
"""


class Motor:
    """One ideal motor."""

    __slots__ = ()

    def torque(self, demand_N_m: float, speed_rad_s: float) -> float:  # noqa: ARG002
        """Torque at the wheel [N·m] for the drive's demand at a wheel speed."""
        return demand_N_m
