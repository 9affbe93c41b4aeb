"""The encoder on a motor's shaft, and the drive's estimator behind it.

Counts are floor(N φ / 2π + phase), with N counts per revolution and a seeded phase within a count.
The drive samples them in its control loop, every T, and tracks them with the phase-locked loop of
the ODrive firmware (0.5.6, `encoder.cpp`), in counts:

    p ← p + T v;   e = count − floor(p);   p ← p + T k_p e;   v ← v + T k_i e                   (1)
    v ← 0 where |v| < T k_i / 2                                                                 (2)

    k_p = 2 w, k_i = w²: both poles at w, the bandwidth [rad/s]; (1) is stable for w T < 2√2 − 2,
    and the firmware refuses k_p T ≥ 1.

The loop runs at its own rate whatever the step: within a step the shaft turns evenly, and the loop
samples it at its own instants. So noise and lag are those of the drive: for 8192 counts and 8 kHz
about 0.01 rev/s rms at w = 1000 rad/s and 0.0003 at 200.

Under effects of faults (`plant.effects`):

    encoder_frozen         the count stays
    encoder_flipped        the count runs backwards
    encoder_kept           other edges are lost at random, in either direction
    encoder_noise_counts   angle noise before the count is taken, beside the encoder's own

An encoder with an index finds lost counts again, where the mark passes (to whole revolutions);
without it they stay lost, also once the fault is over. An angle that isn't finite leaves the
count where it is.
"""

from math import copysign, hypot, isfinite, pi
from random import Random
from typing import Final

from configs import powertrain
from plant.effects import WheelEffects

PER_RADIAN: Final = 1.0 / (2.0 * pi)
"""Revolutions per radian; also rev/s per rad/s."""
_LARGEST_COUNT: Final = 2.0**52
"""Beyond it a float doesn't tell counts apart, so the count stays there."""
_EARLY: Final = 1e-9
"""A sample that is due within this part of a loop period is taken: sums of steps are rounded."""


class Encoder:
    """One incremental encoder with its drive's estimator.

    `step` takes angles with 0 at power-up; `reset` starts it at another angle or in motion.
    """

    __slots__ = (
        "_angle",
        "_counted",
        "_counts_per_rev",
        "_flipped",
        "_frozen",
        "_gain_p",
        "_gain_v",
        "_loss",
        "_model",
        "_noise",
        "_offset",
        "_phase",
        "_plain",
        "_position",
        "_random",
        "_rate_Hz",
        "_since",
        "_velocity",
    )

    def __init__(self, model: powertrain.Encoder, random: Random) -> None:
        self._model = model
        self._random = random
        self._phase = random.random()
        self._counts_per_rev = float(model.counts_per_shaft_rev)
        self._rate_Hz = model.pll_rate_Hz
        bandwidth = model.pll_bandwidth_rad_s / model.pll_rate_Hz
        self._gain_p = 2.0 * bandwidth  # T k_p
        self._gain_v = bandwidth * bandwidth  # T² k_i: velocities are counts per loop period
        self._offset = 0.0  # what the count has more than it should, whole
        self._plain = True
        self.reset()
        self.apply(WheelEffects())

    @property
    def count(self) -> int:
        """The count as of the end of the last step, without angle noise."""
        return int(self._angle // 1.0 + self._offset)

    def reset(self, angle_shaft_rad: float = 0.0, speed_shaft_rad_s: float = 0.0) -> None:
        """Start anew with the estimator settled on this angle and speed, both finite."""
        per_radian = self._model.counts_per_shaft_rev * PER_RADIAN
        self._angle = angle_shaft_rad * per_radian + self._phase
        self._counted = self._angle // 1.0
        self._since = 0.0  # loop periods since the last sample
        self._velocity = speed_shaft_rad_s * per_radian / self._model.pll_rate_Hz
        self._position = self._counted + self._offset + 0.5

    def step(self, angle_shaft_rad: float, dt_s: float) -> tuple[float, float]:
        """(position [rev], velocity [rev/s]) as the drive estimates them after `dt_s`."""
        counts, rate_Hz = self._counts_per_rev, self._rate_Hz
        start = self._angle
        end = angle_shaft_rad * counts * PER_RADIAN + self._phase
        if not -_LARGEST_COUNT <= end <= _LARGEST_COUNT:
            end = copysign(_LARGEST_COUNT, end) if isfinite(end) else start
        periods = dt_s * rate_Hz
        since = self._since
        samples = int(since + periods + _EARLY)
        if samples:
            slope = (end - start) / periods
            first = start + slope * (1.0 - since)
            if not self._plain:
                self._track_faulty(first, slope, samples)
            elif slope or self._velocity or first // 1.0 + self._offset != self._position // 1.0:
                self._track(first + self._offset, slope, samples)
        self._since = since + periods - samples
        self._angle = end
        return self._position / counts, self._velocity * rate_Hz / counts

    def apply(self, effects: WheelEffects) -> None:
        """Let these effects act from now on, and no others; what was lost stays lost."""
        self._frozen, self._flipped = effects.encoder_frozen, effects.encoder_flipped
        self._loss = 1.0 - effects.encoder_kept
        self._noise = hypot(self._model.noise_counts, effects.encoder_noise_counts)
        self._choose_path()

    def jump(self, shaft_rev: float) -> None:
        """Let the count jump, once and for good."""
        self._offset += float(round(shaft_rev * self._model.counts_per_shaft_rev))
        self._choose_path()

    def _choose_path(self) -> None:
        """The plain path is the fast one: nothing happens to counts on the way."""
        astray = self._model.index and self._offset % self._model.counts_per_shaft_rev != 0.0
        plain = not (self._frozen or self._flipped or self._loss or self._noise or astray)
        if plain or self._plain:
            self._counted = self._angle // 1.0
        self._plain = plain

    def _track(self, at: float, slope: float, samples: int) -> None:
        """Equations (1) and (2) at counts `at`, `at + slope`, …: the inner loop."""
        position, velocity = self._position, self._velocity
        gain_p, gain_v = self._gain_p, self._gain_v
        snap = 0.5 * gain_v
        count, estimate = at // 1.0, position // 1.0  # taken anew only where they change
        for _ in range(samples):
            position += velocity
            if not count <= at < count + 1.0:
                count = at // 1.0
            if not estimate <= position < estimate + 1.0:
                estimate = position // 1.0
            error = count - estimate
            if error:
                position += gain_p * error
                velocity += gain_v * error
                if -snap < velocity < snap:
                    velocity = 0.0
            at += slope
        self._position, self._velocity = position, velocity

    def _track_faulty(self, at: float, slope: float, samples: int) -> None:
        """The same with counts that may go astray."""
        gauss = self._random.gauss
        for _ in range(samples):
            seen = at + gauss(0.0, self._noise) if self._noise else at
            self._count_to(seen // 1.0)
            self._track(self._counted + self._offset, 0.0, 1)
            at += slope
        if not (self._frozen or self._flipped or self._loss or self._noise):
            self._choose_path()

    def _count_to(self, true: float) -> None:
        """Go on to the count `true`, with what the faults make of the edges in between."""
        moved, counts = true - self._counted, self._model.counts_per_shaft_rev
        if self._frozen:
            self._offset -= moved
        elif moved:
            if self._flipped:
                self._offset -= 2.0 * moved
            if self._loss:
                # Whole edges; right in the mean, as the number is rounded at random.
                lost = (self._loss * abs(moved) + self._random.random()) // 1.0
                self._offset -= copysign(lost, -moved if self._flipped else moved)
            turn = true // counts
            if self._model.index and turn != self._counted // counts:
                at_mark = self._offset
                if self._flipped:
                    at_mark += 2.0 * (true - counts * turn)  # whichever turn's mark it was
                self._offset -= at_mark - counts * float(round(at_mark / counts))
        self._counted = true
