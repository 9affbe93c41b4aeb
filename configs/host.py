"""Section [host]: the limits that a controller keeps, whatever its law asks.

The limits on ages hold in every run. Torque limit, slew limit and plausibility are off unless
given, so that the paper's law is the paper's; a robot wants all of them.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Le

from configs.parameters import Parameters, Positive, Seconds, SecondsOrZero, parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class Host(Parameters):
    """Supervision of drives, bus and pose; own limits; what follows a fault, and the end."""

    heartbeat_age_limit_s: Seconds = parameter(0.5, "a drive silent for longer has dropped out")
    encoder_age_limit_s: Seconds | None = parameter(
        None, "ten control periods, at least 0.05 s, if not given"
    )
    pose_age_limit_s: Seconds | None = parameter(
        None,
        "the delay and five localisation periods, at least 0.5 s, if not given; counts"
        " where fixes do: not with localisation.source odometry",
    )
    torque_limit_wheel_N_m: Positive | None = parameter(None, "per wheel; none if not given")
    torque_slew_limit_wheel_N_m_s: Positive | None = parameter(
        None, "per wheel, but a stop is at once; none if not given"
    )
    encoder_mismatch_limit_wheel_rad: Positive | None = parameter(
        None,
        "wheel angle against its own speed, integrated and forgotten in 0.2 s: jumps,"
        " freezes and flipped signs; not looked at if not given",
    )
    pose_mismatch_limit_m: Positive | None = parameter(
        None,
        "a fix against the last one carried on by odometry; not looked at if not given",
    )
    dry_run: bool = parameter(False, "everything but torque: the drives stay disarmed")
    on_exit: Literal["idle", "estop"] = parameter(
        "idle", "estop: latched at the drives until their errors are cleared"
    )
    rearm: bool = parameter(False, "a robot that stopped itself arms again once the fault is gone")
    rearm_after_s: SecondsOrZero = parameter(0.5, "all must have been well for this long")
    rearm_attempts: Annotated[int, Ge(1), Le(1000)] = parameter(3, "in a run")
    rearm_limit_s: Seconds = parameter(1.0, "longest wait for closed loop then")
    restarts: Annotated[int, Ge(0), Le(100)] = parameter(
        0,
        "in real time: how often a controller's process that was killed or crashed is started"
        " again, and re-joins",
    )
    bus_error_limit_s: SecondsOrZero = parameter(
        5.0,
        "errors of a bus that isn't ours are tolerated for this long, then the controller gives up",
    )
