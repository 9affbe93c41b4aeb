"""Paths and offsets as controllers evaluate them: sections as they are, splines as coefficients.

Γ_0(s) and l_i(s) of equation (1). The launcher solves for the coefficients once for all
controllers, which import this module for its types: numpy is loaded by the launcher only.
"""

from dataclasses import dataclass
from functools import lru_cache

from configs import paths
from configs.plugins import Choice


@dataclass(frozen=True, slots=True)
class SplinePath:
    """Piecewise quintic polynomials, continuous up to the fourth derivative.

    In segment n, x = Σ_m x_coefficients[n][m] (s − knots[n])^m, same for y. `closed`: s is taken
    modulo the length; else the tangents at both ends go on straight outside the knots.
    """

    knots_m: tuple[float, ...]
    x_coefficients: tuple[tuple[float, ...], ...]
    y_coefficients: tuple[tuple[float, ...], ...]
    closed: bool


ReferencePath = paths.Line | paths.Cosine | paths.Circle | paths.FigureEight | SplinePath | Choice


@dataclass(frozen=True, slots=True)
class VaryingOffset:
    """l_i(s) in the axes of the virtual structure: a quintic spline in s, as in `SplinePath`.

    Constant outside [knots[0], knots[-1]]; its first two derivatives are 0 at both ends.
    """

    knots_m: tuple[float, ...]
    ahead_coefficients: tuple[tuple[float, ...], ...]
    left_coefficients: tuple[tuple[float, ...], ...]


FormationOffset = paths.World | paths.Structure | VaryingOffset | Choice


def reference_path(path: paths.PathShape) -> ReferencePath:
    """The centre's path as the controllers evaluate it."""
    return _spline_path(path) if isinstance(path, paths.Spline) else path


@lru_cache(maxsize=1)
def _spline_path(path: paths.Spline) -> SplinePath:
    from configs.splines import Ends, chord_lengths, quintic_spline

    points = [*path.points_m, path.points_m[0]] if path.closed else list(path.points_m)
    knots = chord_lengths(points)
    ends: Ends = "periodic" if path.closed else "natural"
    x, y = (quintic_spline(knots, [point[n] for point in points], ends) for n in (0, 1))
    return SplinePath(knots, x, y, path.closed)


def formation_offset(offset: paths.Offset) -> FormationOffset:
    """A robot's place in the formation as its controller evaluates it."""
    if not isinstance(offset, paths.Varying):
        return offset
    from configs.splines import quintic_spline

    knots = tuple(knot.s_m for knot in offset.knots)
    ahead = quintic_spline(knots, [knot.ahead_m for knot in offset.knots], "clamped")
    left = quintic_spline(knots, [knot.left_m for knot in offset.knots], "clamped")
    return VaryingOffset(knots, ahead, left)
