"""The encoder on a wheel: what its drive is told of angle and speed.

The ideal encoder has no resolution of its own; the drive's protocol rounds to float32 on the wire.
"""

from math import pi

PER_RADIAN = 1.0 / (2.0 * pi)
"""Revolutions per radian; also rev/s per rad/s."""
