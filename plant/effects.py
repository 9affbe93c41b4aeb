"""The effects of all faults that act on one robot, together: values, made anew at each change.

    factors            multiply
    offsets, loads     add; noises by their squares, as independent ones do
    supply voltage     of the fault that began last

So the order matters nowhere else, and the end of one fault leaves the others as they are. Parts
take these values over as a whole and keep what they have to remember (the current at which a motor
is stuck, the counts that an encoder has lost) as long as the effect lasts.
"""

from dataclasses import dataclass, field, replace
from typing import Final, TypeVar

from configs.faults.base import Side
from configs.sections import Body

_T = TypeVar("_T")

_LEAST_MASS: Final = 1e-3
"""Part of its own mass and inertia that a body keeps, whatever is ordered during a run."""
_LEAST_ROLL: Final = 0.01
_RADII = (0.01, 100.0)
_MOST_FRICTION: Final = 1e4


def of_side(right_left: tuple[_T, _T], side: Side) -> tuple[_T, ...]:
    """Of the (right, left) one, or both."""
    right, left = right_left
    if side == "both":
        return right_left
    return (right,) if side == "right" else (left,)


@dataclass(slots=True)
class WheelEffects:
    """Effects behind one wheel: motor and encoder at the shaft, friction and slip at the wheel."""

    torque_factor: float = 1.0
    torque_stuck: bool = False
    torque_zero: bool = False
    fet_rise_K: float = 0.0
    motor_rise_K: float = 0.0
    encoder_frozen: bool = False
    encoder_flipped: bool = False
    encoder_kept: float = 1.0
    """Share of its counts that the encoder doesn't lose."""
    encoder_noise_counts: float = 0.0
    friction_factor: float = 1.0
    rolled: float = 1.0
    """Speed of the rim over ground by the speed at which the wheel turns it: 1 − slip ratio."""

    @property
    def of_powertrain(self) -> bool:
        """Whether the torque isn't the demand's or the encoder isn't sound."""
        motor = self.torque_stuck or self.torque_zero or self.torque_factor != 1.0
        encoder = self.encoder_frozen or self.encoder_flipped or self.encoder_kept != 1.0
        return motor or encoder or self.encoder_noise_counts != 0.0


@dataclass(slots=True)
class PoseDrift:
    """Rates at which poses drift away from a scenario time on."""

    from_ns: int
    x_m_s: float
    y_m_s: float
    theta_rad_s: float


@dataclass(slots=True)
class RobotEffects:
    """Effects on one robot."""

    right: WheelEffects = field(default_factory=WheelEffects)
    left: WheelEffects = field(default_factory=WheelEffects)
    force_body_N: float = 0.0
    torque_body_N_m: float = 0.0
    mass_kg: float = 0.0
    inertia_kg_m2: float = 0.0
    com_offset_m: float = 0.0
    radius_factor: float = 1.0
    supply_V: float | None = None
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Offset of all poses: x, y [m], θ [rad]."""
    drifts: list[PoseDrift] = field(default_factory=list)

    @property
    def rolled(self) -> tuple[float, float]:
        """`WheelEffects.rolled` of the (right, left) wheel."""
        return max(self.right.rolled, _LEAST_ROLL), max(self.left.rolled, _LEAST_ROLL)

    @property
    def of_poses(self) -> bool:
        """Whether poses aren't right."""
        return bool(self.drifts) or any(self.pose)

    def loaded(self, body: Body) -> Body:
        """The parameters of a body under these effects."""
        mass, inertia = body.body_mass_kg, body.body_inertia_kg_m2
        right, left = self.right.friction_factor, self.left.friction_factor
        return replace(
            body,
            body_mass_kg=max(mass + self.mass_kg, _LEAST_MASS * mass),
            body_inertia_kg_m2=max(inertia + self.inertia_kg_m2, _LEAST_MASS * inertia),
            com_offset_m=body.com_offset_m + self.com_offset_m,
            wheel_radius_m=body.wheel_radius_m * min(max(self.radius_factor, _RADII[0]), _RADII[1]),
            damping_right_wheel_N_m_s=body.damping_right_wheel_N_m_s * min(right, _MOST_FRICTION),
            damping_left_wheel_N_m_s=body.damping_left_wheel_N_m_s * min(left, _MOST_FRICTION),
        )
