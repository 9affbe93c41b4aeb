"""The numbers of one case as the loop has them: records of arrays, and what their codes stand for.

Fields are the symbols of the modules whose functions they are given to.
"""

from collections.abc import Sequence
from functools import cache
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.laws.adaptive_dsc import AdaptiveDsc
from configs.signals import PLANT_SIGNALS, controller_signals

PAPER, ROBUST = 0, 1
"""Laws."""
COSINE, LINE, CIRCLE, FIGURE_EIGHT, SPLINE = 0, 1, 2, 3, 4
"""Paths of the centre."""
WORLD, STRUCTURE, VARYING = 0, 1, 2
"""Offsets."""
FUSED, EXTERNAL, ODOMETRY = 0, 1, 2
"""Sources of poses."""
UNHEARD, HEARD, OWN_ESTIMATE = 0, 1, 2
"""What a robot takes for v_r: 0, the leader's speed, or its own v̂: nothing heard over an emulated
network."""

_FLOAT, _WHOLE = "f8", "i8"


def _fields(kind: str, names: str) -> list[tuple[str, str]]:
    return [(name, kind) for name in names.split()]


_MAP = [
    *_fields(_FLOAT, "degree h"),
    *_fields(_FLOAT, "v_1 v_2 v_3 mu_1 mu_2 mu_3 mu_4 mu_5 mu_6 s_1 s_2 s_3 s_4 s_5 s_6"),
]
MAP = np.dtype([("computed", _WHOLE), *_MAP])
"""The map of a period of the coordination, for a degree and h."""

CASE = np.dtype(
    [
        *_fields(_WHOLE, "ticks period_ns share_every localise_every pose_delay_ticks substeps"),
        *_fields(_WHOLE, "countdown_ns heartbeat_ns rearms"),
        *_fields(_WHOLE, "localisation extrapolates path closed last_knot"),
        *_fields(_FLOAT, "period_s half_period_s p q age_limit_s silence_limit_s"),
        *_fields(_FLOAT, "s_min_m s_max_m v_min_m_s v_max_m_s v_low_m_s v_high_m_s"),
        *_fields(_FLOAT, "path_1 path_2 path_3 path_4 path_5"),
    ]
)
"""What all robots of a case have in common."""

ROBOT = np.dtype(
    [
        *_fields(_WHOLE, "law host_limits disturbed leader link"),
        *_fields(_WHOLE, "first_edge last_edge offset first_knot last_knot"),
        # the law: its constants, h K_5, the bounds of the estimates, its own limits; the host's
        *_fields(_FLOAT, "k1 k2 k3 k4 gamma_1 gamma_2 gamma_3 move_1 move_2 move_3"),
        *_fields(_FLOAT, "kappa_keep kappa_gain sgn_width radius half_track_known"),
        *_fields(_FLOAT, "rate_1 rate_2 rate_3 rate_4 rate_5 rate_6 rate_7 rate_8"),
        *_fields(_FLOAT, "sigma sigma_square sigma_span sigma_limit v_limit torque_limit"),
        *_fields(_FLOAT, "host_limit host_step"),
        # the path, the leader link, the localiser
        *_fields(_FLOAT, "path_1 path_2 path_3 path_4 path_5 path_6"),
        *_fields(_FLOAT, "half_radius half_radius_over_b"),
        # the drives
        *_fields(_FLOAT, "to_shaft_right to_shaft_left to_wheel_right to_wheel_left"),
        *_fields(_FLOAT, "wheel_rad_per_rev_right wheel_rad_per_rev_left gear_right gear_left"),
        # the body
        *_fields(_FLOAT, "centrifugal coriolis damping_11 damping_12 damping_21 damping_22"),
        *_fields(_FLOAT, "gain_1 gain_2 half_track inv_right inv_left fastest_m_s"),
        *_fields(_FLOAT, "amplitude wave_rate phase"),
    ]
)
"""What doesn't change of one robot."""

STATE = np.dtype(
    [
        # whether the law has had its first tick; why and when the robot stopped, the body diverged
        *_fields(_WHOLE, "started stopped stop_tick diverged diverged_tick"),
        *_fields(_FLOAT, "diverged_v diverged_omega diverged_right diverged_left"),
        # the body; torques at the shafts, and what was asked of the motors, at the wheels
        *_fields(_FLOAT, "x y theta v omega right_wheel_rad left_wheel_rad"),
        *_fields(_FLOAT, "torque_right_shaft torque_left_shaft demand_right demand_left"),
        # the controller: wheels as they were seen last, odometry, fix and odometry at its instant
        *_fields(_FLOAT, "seen_right_rad seen_left_rad v_used omega_used o_x o_y o_theta"),
        *_fields(_FLOAT, "f_x f_y f_theta a_x a_y a_theta a_cos a_sin"),
        # coordination, and its map for a degree
        *_fields(_FLOAT, "v_hat mu s"),
        *_MAP,
        # the law, and the limits of the host
        *_fields(_FLOAT, "alpha_theta alpha_v alpha_omega"),
        *_fields(_FLOAT, "theta_1 theta_2 theta_3 theta_4 theta_5 theta_6 theta_7 theta_8 kappa"),
        *_fields(_FLOAT, "limited_right limited_left"),
    ]
)
"""What changes of one robot."""

CONTROLLER_SIGNALS = controller_signals(AdaptiveDsc.SIGNALS)
"""Of a controller: the laws that the kernel has say the same."""
TRUTH = np.dtype([(signal.name, _FLOAT) for signal in PLANT_SIGNALS])
TOLD = np.dtype([(signal.name, _FLOAT) for signal in CONTROLLER_SIGNALS])
"""The rows of the plant and of a controller."""

EDGE = np.dtype(
    [
        ("weight", _FLOAT),
        *_fields(_WHOLE, "speaker steady next_change last_change counts"),
    ]
)
"""An edge to a robot: a_ij, who is heard, whether the newest share always counts; else the changes
that are next, and the share that counts now. Of a leader link 1 or 0 counts: whether it exists."""


def records(layout: np.dtype[np.void], rows: Sequence[tuple[Any, ...]]) -> NDArray[np.void]:
    """Rows as an array; to the loop its fields are attributes, uncompiled as of `np.recarray`."""
    pack = _packing(layout).pack
    return np.frombuffer(bytearray().join([pack(*row) for row in rows]), layout)


@cache
def _packing(layout: np.dtype[np.void]) -> Struct:
    """The record as `struct` makes it: faster than numpy by a multiple."""
    kinds = {np.dtype(_FLOAT): "d", np.dtype(_WHOLE): "q"}
    return Struct("<" + "".join(kinds[layout[n]] for n in range(len(layout.names or ()))))


def one(layout: np.dtype[np.void]) -> NDArray[np.void]:
    """One record of zeros."""
    return np.zeros(1, layout)
