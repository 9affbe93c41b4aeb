"""Reference paths: the desired pose at a path variable s, equations (1), (10), (11).

    Γ_i(s) = Γ_0(s) + R(θ_d0(s)) l_i(s)                                          (1)
    θ_d(s) = atan2(y', x')          in (−π, π]
    v̄_d(s) = √(x'² + y'²)           speed along the path per unit of ṡ           (10)
    ω̄_d(s) = (x' y'' − x'' y') / (x'² + y'²)    turn rate per unit of ṡ          (11)

Γ_0 is the path of the formation's centre, l_i the robot's offset in axes that turn with it, and
primes are derivatives by s. A shape gives a point and its first three derivatives (a `Jet`): an
offset that turns with the path needs θ_d0''. A user's own shape is a dataclass of parameters with a
method `jet(s)` that returns the jets of x and y; for an offset, those of ahead and left. It raises
`ShapeError` where this fails or gives anything else than finite numbers.

The shapes' equations are functions of numbers, which the batch kernel of sweeps compiles as they
stand; closures bind them to the parameters of a scenario.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from math import atan2, cos, isfinite, sin, sqrt
from typing import Any, NamedTuple

from agents.laws.failure import ShapeError, number, raised
from agents.laws.interface import Reference, RobotPath
from configs.curves import FormationOffset, ReferencePath, SplinePath, VaryingOffset
from configs.paths import Circle, Cosine, FigureEight, Line, Structure, World
from configs.plugins import Choice, file_of

Point = tuple[float, float, float, float, float]
"""The numbers of a `Reference`."""


class Jet(NamedTuple):
    """A value and its first three derivatives by s."""

    value: float
    d1: float
    d2: float
    d3: float


class PlanarJet(NamedTuple):
    """Two coordinates as jets."""

    x: Jet
    y: Jet


_Curve = Callable[[float], PlanarJet]
Knots = Sequence[float]
Pieces = Sequence[Sequence[float]]
"""Coefficients of a spline: six a segment, lowest power first."""


def robot_path(path: ReferencePath, offset: FormationOffset) -> RobotPath:
    """The path Γ_i of one robot as a function of its path variable."""
    if isinstance(path, Cosine) and isinstance(offset, World):
        return _shifted_cosine(path, offset)
    centre = _centre_path(path)
    match offset:
        case World():
            return _shifted(centre, offset.x_m, offset.y_m)
        case Structure():
            ahead = Jet(offset.ahead_m, 0.0, 0.0, 0.0)
            rest = PlanarJet(ahead, Jet(offset.left_m, 0.0, 0.0, 0.0))
            return _turning(centre, lambda _: rest)
        case VaryingOffset():
            return _turning(centre, _varying(offset))
        case Choice():
            return _turning(centre, own_curve(offset))


def reference_of(x: Jet, y: Jet) -> Point:
    """(1), (10), (11) of a point and its derivatives."""
    square = x.d1 * x.d1 + y.d1 * y.d1
    omega_bar = (x.d1 * y.d2 - x.d2 * y.d1) / square
    return x.value, y.value, atan2(y.d1, x.d1), sqrt(square), omega_bar


# --- offsets --------------------------------------------------------------------------------------


def _shifted_cosine(path: Cosine, offset: World) -> RobotPath:
    """The paper's case, written out: it is evaluated at every tick."""
    x_0, y_0, a, k, ak, akk = cosine_numbers(path, offset)

    def reference_at(s: float) -> Reference:
        x, y, theta, v_bar, omega_bar = cosine_reference(s, x_0, y_0, a, k, ak, akk)
        return Reference(x, y, theta, v_bar, omega_bar)

    return reference_at


def cosine_numbers(path: Cosine, offset: World) -> tuple[float, float, float, float, float, float]:
    """What `cosine_reference` takes beside s."""
    a, k = path.amplitude_m, path.wavenumber_rad_m
    x_0, y_0 = path.start_m[0] + offset.x_m, path.start_m[1] + offset.y_m
    return x_0, y_0, a, k, a * k, a * k * k


def cosine_reference(
    s: float, x_0: float, y_0: float, a: float, k: float, ak: float, akk: float
) -> Point:
    """On the cosine; `ak` and `akk` are a k and a k²."""
    c = cos(k * s)
    dy = -ak * sin(k * s)
    square = 1.0 + dy * dy
    return x_0 + s, y_0 + a * c, atan2(dy, 1.0), sqrt(square), -akk * c / square


def _shifted(centre: _Curve, x_m: float, y_m: float) -> RobotPath:
    def reference_at(s: float) -> Reference:
        return Reference(*shifted_reference(centre(s), x_m, y_m))

    return reference_at


def shifted_reference(centre: PlanarJet, x_m: float, y_m: float) -> Point:
    """Of a robot whose offset is fixed in world axes."""
    x, y, theta, v_bar, omega_bar = reference_of(centre.x, centre.y)
    return x + x_m, y + y_m, theta, v_bar, omega_bar


def _turning(centre: _Curve, offset: _Curve) -> RobotPath:
    """Γ_0 + R(θ) l with θ = θ_d0(s), differentiated twice; R' = θ' R J, J a quarter turn."""

    def reference_at(s: float) -> Reference:
        return Reference(*turning_reference(centre(s), offset(s)))

    return reference_at


def turning_reference(centre: PlanarJet, offset: PlanarJet) -> Point:
    """Of a robot whose offset turns with the path."""
    x, y = centre.x, centre.y
    l_x, l_y = offset.x, offset.y
    square = x.d1 * x.d1 + y.d1 * y.d1
    cross = x.d1 * y.d2 - x.d2 * y.d1
    turn = cross / square  # θ'
    turn_rate = (  # θ''
        x.d1 * y.d3 - x.d3 * y.d1 - 2.0 * turn * (x.d1 * x.d2 + y.d1 * y.d2)
    ) / square
    norm = sqrt(square)
    c, n = x.d1 / norm, y.d1 / norm
    # In the turning axes: l, l' + θ' J l, l'' + 2 θ' J l' + θ'' J l − θ'² l.
    u1 = l_x.d1 - turn * l_y.value
    w1 = l_y.d1 + turn * l_x.value
    u2 = l_x.d2 - 2.0 * turn * l_y.d1 - turn_rate * l_y.value - turn * turn * l_x.value
    w2 = l_y.d2 + 2.0 * turn * l_x.d1 + turn_rate * l_x.value - turn * turn * l_y.value
    return reference_of(
        Jet(
            x.value + c * l_x.value - n * l_y.value,
            x.d1 + c * u1 - n * w1,
            x.d2 + c * u2 - n * w2,
            0.0,
        ),
        Jet(
            y.value + n * l_x.value + c * l_y.value,
            y.d1 + n * u1 + c * w1,
            y.d2 + n * u2 + c * w2,
            0.0,
        ),
    )


def _varying(offset: VaryingOffset) -> _Curve:
    knots = offset.knots_m
    ahead, left = offset.ahead_coefficients, offset.left_coefficients

    def jet_at(s: float) -> PlanarJet:
        return varying_jet(s, knots, ahead, left)

    return jet_at


def varying_jet(s: float, knots: Knots, ahead: Pieces, left: Pieces) -> PlanarJet:
    """The jets of an offset that changes along the path."""
    inside = min(max(s, knots[0]), knots[-1])
    n = min(bisect_right(knots, inside), len(ahead)) - 1
    u = inside - knots[n]
    x, y = _polynomial(ahead[n], u), _polynomial(left[n], u)
    if inside != s:
        return PlanarJet(Jet(x.value, 0.0, 0.0, 0.0), Jet(y.value, 0.0, 0.0, 0.0))
    return PlanarJet(x, y)


# --- paths of the centre --------------------------------------------------------------------------


def _centre_path(path: ReferencePath) -> _Curve:
    match path:
        case Line():
            return _line(path)
        case Cosine():
            return _cosine(path)
        case Circle():
            return _circle(path)
        case FigureEight():
            return _figure_eight(path)
        case SplinePath():
            return _spline(path)
        case Choice():
            return own_curve(path)


def own_curve(choice: Choice) -> Callable[[float], PlanarJet]:
    """A path or an offset of the user's own: `jet(s)` of its class, its answers checked.

    The curve raises `ShapeError` where it fails or gives anything else than finite numbers.
    """
    shape: Any = choice.parameters
    jet = shape.jet
    name = f"{choice.plugin.kind.word} {choice.name}"
    file = file_of(type(shape))

    def jet_at(s: float) -> PlanarJet:
        try:
            given = jet(s)
        except (Exception, SystemExit) as error:
            raise ShapeError(f"{name}: {raised(error)}") from error
        try:
            x, y = given
            made = PlanarJet(Jet(*map(number, x)), Jet(*map(number, y)))
        except (TypeError, ValueError) as error:
            raise ShapeError(
                f"{name}: {file}: jet must return ((x, x', x'', x'''), (y, y', y'', y''')),"
                f" numbers; it returned {given!r:.80}"
            ) from error
        if not all(map(isfinite, (*made.x, *made.y))):
            raise ShapeError(
                f"{name}: {file}: jet({s:.6g}) is not finite: it returned {given!r:.200}"
            )
        return made

    return jet_at


def _line(path: Line) -> _Curve:
    (x_0, y_0), (c, n) = path.start_m, line_tangent(path)

    def jet_at(s: float) -> PlanarJet:
        return line_jet(s, x_0, y_0, c, n)

    return jet_at


def line_tangent(path: Line) -> tuple[float, float]:
    """The tangent of a line."""
    return cos(path.heading_rad), sin(path.heading_rad)


def line_jet(s: float, x_0: float, y_0: float, c: float, n: float) -> PlanarJet:
    """The jets of a line with the tangent (c, n)."""
    return PlanarJet(Jet(x_0 + s * c, c, 0.0, 0.0), Jet(y_0 + s * n, n, 0.0, 0.0))


def _cosine(path: Cosine) -> _Curve:
    (x_0, y_0), a, k = path.start_m, path.amplitude_m, path.wavenumber_rad_m

    def jet_at(s: float) -> PlanarJet:
        return cosine_jet(s, x_0, y_0, a, k)

    return jet_at


def cosine_jet(s: float, x_0: float, y_0: float, a: float, k: float) -> PlanarJet:
    """The jets of a cosine of amplitude a and wave number k."""
    return PlanarJet(Jet(x_0 + s, 1.0, 0.0, 0.0), _add(y_0, _wave(a, k, s, 1)))


def _circle(path: Circle) -> _Curve:
    (x_0, y_0), radius = path.centre_m, path.radius_m
    rate = circle_rate(path)
    start = path.start_angle_rad / rate

    def jet_at(s: float) -> PlanarJet:
        return circle_jet(s, x_0, y_0, radius, rate, start)

    return jet_at


def circle_rate(path: Circle) -> float:
    """Angle per metre of arc [rad/m]."""
    return (-1.0 if path.clockwise else 1.0) / path.radius_m


def circle_jet(
    s: float, x_0: float, y_0: float, radius: float, rate: float, start: float
) -> PlanarJet:
    """The jets of a circle; `start`: the arc up to where s is 0."""
    turned = s + start
    return PlanarJet(
        _add(x_0, _wave(radius, rate, turned, 1)), _add(y_0, _wave(radius, rate, turned, 0))
    )


def _figure_eight(path: FigureEight) -> _Curve:
    (x_0, y_0), length, width = path.centre_m, path.half_length_m, path.half_width_m
    rate = 1.0 / length

    def jet_at(s: float) -> PlanarJet:
        return figure_eight_jet(s, x_0, y_0, length, width, rate)

    return jet_at


def figure_eight_jet(
    s: float, x_0: float, y_0: float, length: float, width: float, rate: float
) -> PlanarJet:
    """The jets of a figure eight of half this length and width."""
    return PlanarJet(
        _add(x_0, _wave(length, rate, s, 0)), _add(y_0, _wave(width, 2.0 * rate, s, 0))
    )


def _spline(path: SplinePath) -> _Curve:
    knots, x, y, closed = path.knots_m, path.x_coefficients, path.y_coefficients, path.closed

    def jet_at(s: float) -> PlanarJet:
        return spline_jet(s, knots, x, y, closed)

    return jet_at


def spline_jet(
    s: float, knots: Knots, x_pieces: Pieces, y_pieces: Pieces, closed: bool
) -> PlanarJet:
    """The jets of a spline, closed or with straight ends."""
    first, last = knots[0], knots[-1]
    if closed:
        inside = first + (s - first) % (last - first)
    else:
        inside = min(max(s, first), last)
    n = min(bisect_right(knots, inside), len(knots) - 1) - 1
    u = inside - knots[n]
    x, y = _polynomial(x_pieces[n], u), _polynomial(y_pieces[n], u)
    if closed or inside == s:
        return PlanarJet(x, y)
    beyond = s - inside
    return PlanarJet(
        Jet(x.value + beyond * x.d1, x.d1, 0.0, 0.0),
        Jet(y.value + beyond * y.d1, y.d1, 0.0, 0.0),
    )


def _wave(amplitude: float, k: float, s: float, quarters: int) -> Jet:
    """The jet of amplitude sin(k s + quarters π/2)."""
    waves = (sin(k * s), cos(k * s), -sin(k * s), -cos(k * s))
    a = amplitude
    return Jet(
        a * waves[quarters % 4],
        a * k * waves[(quarters + 1) % 4],
        a * k * k * waves[(quarters + 2) % 4],
        a * k * k * k * waves[(quarters + 3) % 4],
    )


def _add(constant: float, jet: Jet) -> Jet:
    return Jet(constant + jet.value, jet.d1, jet.d2, jet.d3)


def _polynomial(coefficients: Sequence[float], u: float) -> Jet:
    """Horner's rule for Σ c_m u^m and its first three derivatives."""
    value = d1 = d2 = d3 = 0.0
    for m in range(len(coefficients) - 1, -1, -1):
        d3 = d3 * u + 3.0 * d2
        d2 = d2 * u + 2.0 * d1
        d1 = d1 * u + value
        value = value * u + coefficients[m]
    return Jet(value, d1, d2, d3)
