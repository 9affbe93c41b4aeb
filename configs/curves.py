"""Paths and offsets as controllers evaluate them: equation (1), splines as coefficients."""

from dataclasses import dataclass

from configs import paths
from configs.plugins import Choice
from configs.splines import Ends, chord_lengths, quintic_spline

# --- reference paths: Γ_0(s) of equation (1) ------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LinePath:
    """Γ_0(s) = start + s (cos heading, sin heading)."""

    start_x_m: float
    start_y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class CosinePath:
    """A cosine along world x, the shape of the paper's section 4.

    Γ_0(s) = (start_x + s, start_y + amplitude cos(wavenumber s)).
    """

    start_x_m: float
    start_y_m: float
    amplitude_m: float
    wavenumber_rad_m: float


@dataclass(frozen=True, slots=True)
class CirclePath:
    """A circle, s in metres of arc.

    Γ_0(s) = centre + radius (cos φ, sin φ), φ = start_angle ± s / radius; + is counter-clockwise.
    """

    centre_x_m: float
    centre_y_m: float
    radius_m: float
    start_angle_rad: float
    clockwise: bool


@dataclass(frozen=True, slots=True)
class FigureEightPath:
    """The lemniscate of Gerono.

    Γ_0(s) = centre + (half_length sin φ, half_width sin 2φ), φ = s / half_length.
    """

    centre_x_m: float
    centre_y_m: float
    half_length_m: float
    half_width_m: float


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


ReferencePath = LinePath | CosinePath | CirclePath | FigureEightPath | SplinePath | Choice


# --- formation offsets: R(θ_d0(s)) l_i(s) of equation (1) -----------------------------------------


@dataclass(frozen=True, slots=True)
class WorldOffset:
    """R(θ_d0) l_i = (x, y), constant in world axes: the paper's section 4 has (0, o_i)."""

    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class StructureOffset:
    """l_i = (ahead, left), constant in the axes of the virtual structure.

    Those axes turn with the path: `ahead` is along its tangent.
    """

    ahead_m: float
    left_m: float


@dataclass(frozen=True, slots=True)
class VaryingOffset:
    """l_i(s) in the axes of the virtual structure: a quintic spline in s, as in `SplinePath`.

    Constant outside [knots[0], knots[-1]]; its first two derivatives are 0 at both ends.
    """

    knots_m: tuple[float, ...]
    ahead_coefficients: tuple[tuple[float, ...], ...]
    left_coefficients: tuple[tuple[float, ...], ...]


FormationOffset = WorldOffset | StructureOffset | VaryingOffset | Choice


def reference_path(path: paths.PathShape) -> ReferencePath:
    """The centre's path as the controllers evaluate it."""
    match path:
        case Choice():
            return path
        case paths.Line():
            return LinePath(*path.start_m, path.heading_rad)
        case paths.Cosine():
            return CosinePath(*path.start_m, path.amplitude_m, path.wavenumber_rad_m)
        case paths.Circle():
            return CirclePath(*path.centre_m, path.radius_m, path.start_angle_rad, path.clockwise)
        case paths.FigureEight():
            return FigureEightPath(*path.centre_m, path.half_length_m, path.half_width_m)
        case paths.Spline():
            points = [*path.points_m, path.points_m[0]] if path.closed else list(path.points_m)
            knots = chord_lengths(points)
            ends: Ends = "periodic" if path.closed else "natural"
            x, y = (quintic_spline(knots, [point[n] for point in points], ends) for n in (0, 1))
            return SplinePath(knots, x, y, path.closed)


def formation_offset(offset: paths.Offset) -> FormationOffset:
    """A robot's place in the formation as its controller evaluates it."""
    match offset:
        case Choice():
            return offset
        case paths.World():
            return WorldOffset(offset.x_m, offset.y_m)
        case paths.Structure():
            return StructureOffset(offset.ahead_m, offset.left_m)
        case paths.Varying():
            knots = tuple(knot.s_m for knot in offset.knots)
            ahead = quintic_spline(knots, [knot.ahead_m for knot in offset.knots], "clamped")
            left = quintic_spline(knots, [knot.left_m for knot in offset.knots], "clamped")
            return VaryingOffset(knots, ahead, left)
