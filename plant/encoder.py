"""The encoder on a wheel: what its drive is told of angle and speed.

The ideal encoder has no resolution of its own; the drive's protocol rounds to float32 on the wire.
"""

from math import pi

_PER_RADIAN = 1.0 / (2.0 * pi)


def revolutions(angle_rad: float) -> float:
    """Revolutions for a wheel angle; also rev/s for rad/s."""
    return angle_rad * _PER_RADIAN
