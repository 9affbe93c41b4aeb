"""The localisation system where faults make it wrong: poses with an offset, adrift, or off once."""

from bridge.network.messages import PoseFix
from plant.effects import RobotEffects

Offset = tuple[float, float, float]


class FaultyLocalisation:
    """What becomes of the poses of one robot."""

    __slots__ = ("_effects", "_jumps")

    def __init__(self) -> None:
        self._effects = RobotEffects()
        self._jumps: list[Offset] = []

    def apply(self, effects: RobotEffects) -> None:
        """Let these effects act from now on, and no others."""
        self._effects = effects

    def jump(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Let the next pose alone be off by this."""
        self._jumps.append((x_m, y_m, theta_rad))

    def seen(self, fix: PoseFix) -> PoseFix:
        """A pose as it is told."""
        offsets = [self._effects.pose, *self._jumps]
        self._jumps.clear()
        for drift in self._effects.drifts:
            since_s = (fix.t_ns - drift.from_ns) * 1e-9
            offsets.append(
                (drift.x_m_s * since_s, drift.y_m_s * since_s, drift.theta_rad_s * since_s)
            )
        x, y, theta = (sum(parts) for parts in zip(*offsets, strict=True))
        return PoseFix(fix.tick, fix.t_ns, fix.x_m + x, fix.y_m + y, fix.theta_rad + theta)
