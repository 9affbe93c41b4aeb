"""Motors and encoders of the simpler presets, under effects of faults.

Without any, the drive's demand is the torque and the shaft's motion the encoder's, and nothing here
is asked. With noise of σ counts, N counts to a revolution, the drive's estimator
(`plant.encoder`, w T small) would pass on, of position and velocity,

    σ_p = σ/N √(5 w T / 4) [rev],   σ_v = σ/N √(w³ T / 4) [rev/s]                               (1)

by its impulse responses w (2 − w t) e^(−wt) and w² (1 − w t) e^(−wt).
"""

from math import sqrt
from random import Random

from configs import powertrain
from configs.brief import PowertrainModel
from plant.effects import RobotEffects, WheelEffects
from plant.encoder import PER_RADIAN

Pair = tuple[float, float]
"""Two numbers, such as those of the (right, left) wheel."""


def shaft_motion(angle_wheel_rad: float, speed_wheel_rad_s: float, gear: float) -> Pair:
    """Angle [rev] and speed [rev/s] of a shaft, by those of its wheel."""
    per_radian = PER_RADIAN * gear
    return angle_wheel_rad * per_radian, speed_wheel_rad_s * per_radian


class ExactMotor:
    """The torque that a wheel gets for its drive's demand."""

    __slots__ = ("_factor", "_stuck_N_m", "_zero")

    def __init__(self) -> None:
        self._stuck_N_m: float | None = None
        self.apply(WheelEffects(), 0.0)

    def apply(self, effects: WheelEffects, torque_N_m: float) -> None:
        """Let these effects act from now on, and no others; the torque is that of this moment."""
        self._factor, self._zero = effects.torque_factor, effects.torque_zero
        if not effects.torque_stuck:
            self._stuck_N_m = None
        elif self._stuck_N_m is None:
            self._stuck_N_m = torque_N_m

    def torque(self, demand_N_m: float) -> float:
        """The torque for a demand, both on the same side of the gear."""
        if self._zero:
            return 0.0
        return self._factor * (demand_N_m if self._stuck_N_m is None else self._stuck_N_m)


class ExactEncoder:
    """The position and speed that a drive reads of its shaft."""

    __slots__ = (
        "_counts_rms",
        "_gain",
        "_offset_rev",
        "_position_rev",
        "_random",
        "_seen_rev",
        "_speed_rev_s",
    )

    def __init__(self, model: powertrain.Encoder, random: Random, shaft_rev: float) -> None:
        loop = model.pll_bandwidth_rad_s / model.pll_rate_Hz
        count_rev = 1.0 / model.counts_per_shaft_rev
        self._position_rev = count_rev * sqrt(1.25 * loop)  # (1), of one count
        self._speed_rev_s = count_rev * model.pll_bandwidth_rad_s * sqrt(0.25 * loop)
        self._random = random
        self._offset_rev = 0.0
        self._seen_rev = shaft_rev
        self.apply(WheelEffects(), shaft_rev)

    def apply(self, effects: WheelEffects, shaft_rev: float) -> None:
        """Let these effects act from this shaft angle on; what was lost stays lost."""
        if self._seen_rev != shaft_rev:
            self.read(shaft_rev, 0.0)
        sign = -1.0 if effects.encoder_flipped else 1.0
        self._gain = 0.0 if effects.encoder_frozen else sign * effects.encoder_kept
        self._counts_rms = effects.encoder_noise_counts if self._gain else 0.0

    def jump(self, shaft_rev: float) -> None:
        """Let the position jump, once and for good."""
        self._offset_rev += shaft_rev

    def read(self, shaft_rev: float, shaft_rev_s: float) -> tuple[float, float]:
        """(position [rev], speed [rev/s]) as the drive reads them."""
        self._offset_rev += (self._gain - 1.0) * (shaft_rev - self._seen_rev)
        self._seen_rev = shaft_rev
        position, speed = shaft_rev + self._offset_rev, self._gain * shaft_rev_s
        if self._counts_rms:
            gauss = self._random.gauss
            position += gauss(0.0, self._counts_rms * self._position_rev)
            speed += gauss(0.0, self._counts_rms * self._speed_rev_s)
        return position, speed


class ExactPowertrain:
    """Motors and encoders of both wheels."""

    __slots__ = ("_left_motor", "_right_motor", "encoders")

    def __init__(self, model: PowertrainModel, shafts_rev: Pair) -> None:
        self._right_motor, self._left_motor = ExactMotor(), ExactMotor()
        right, left = (
            ExactEncoder(model.encoder, Random(f"{model.seed}/{side} encoder"), shaft_rev)
            for side, shaft_rev in zip(("right", "left"), shafts_rev, strict=True)
        )
        self.encoders = right, left

    def apply(self, effects: RobotEffects, torques_N_m: Pair, shafts_rev: Pair) -> None:
        """Let these effects act from this moment on, and no others."""
        self._right_motor.apply(effects.right, torques_N_m[0])
        self._left_motor.apply(effects.left, torques_N_m[1])
        self.encoders[0].apply(effects.right, shafts_rev[0])
        self.encoders[1].apply(effects.left, shafts_rev[1])

    def torques(self, right_N_m: float, left_N_m: float) -> Pair:
        """The torques for these demands."""
        return self._right_motor.torque(right_N_m), self._left_motor.torque(left_N_m)
