"""Sections [path] and [robot.offset]: the shapes that are shipped, and shapes of the user's own.

Γ_0(s) and l_i(s) of equation (1). Splines become coefficients for the controllers in
`configs.curves`; all others reach them as they stand here.
"""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from annotated_types import Len

from configs.choices import AlsoOwn, Chooser
from configs.parameters import Finite, Parameters, Point, Positive, Tagged
from configs.plugins import Choice, Kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Line(Parameters):
    """A straight line: Γ_0(s) = start + s (cos heading, sin heading)."""

    kind: Literal["line"]
    start_m: Point = (0.0, 0.0)
    heading_rad: Finite = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Cosine(Parameters):
    """A cosine along world x: Γ_0(s) = start + (s, amplitude cos(wavenumber s))."""

    kind: Literal["cosine"]
    start_m: Point = (0.0, 0.0)
    amplitude_m: Finite = 1.0
    wavenumber_rad_m: Positive = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle(Parameters):
    """A circle, s in metres of arc: Γ_0(s) = centre + radius (cos φ, sin φ).

    φ = start_angle ± s / radius; + is counter-clockwise.
    """

    kind: Literal["circle"]
    centre_m: Point = (0.0, 0.0)
    radius_m: Positive
    start_angle_rad: Finite = 0.0
    clockwise: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureEight(Parameters):
    """The lemniscate of Gerono: Γ_0(s) = centre + (half_length sin φ, half_width sin 2φ).

    φ = s / half_length.
    """

    kind: Literal["figure_eight"]
    centre_m: Point = (0.0, 0.0)
    half_length_m: Positive
    half_width_m: Positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Spline(Parameters):
    """A quintic spline through points; s is the length of the polygon through them."""

    kind: Literal["spline"]
    points_m: Annotated[tuple[Point, ...], Len(2, 200)]
    closed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class World(Parameters):
    """Offset fixed in world axes: R(θ_d0) l_i = (x, y), as in the paper's section 4."""

    kind: Literal["world"]
    x_m: Finite = 0.0
    y_m: Finite = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure(Parameters):
    """Offset fixed in the axes of the formation, which turn with the path: l_i = (ahead, left).

    `ahead` is along the tangent of the path.
    """

    kind: Literal["structure"]
    ahead_m: Finite = 0.0
    left_m: Finite = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Knot(Parameters):
    """Offset at one place of the path."""

    s_m: Finite
    ahead_m: Finite
    left_m: Finite


@dataclass(frozen=True, slots=True, kw_only=True)
class Varying(Parameters):
    """Offset that changes along the path, smoothly through these knots and constant outside."""

    kind: Literal["varying"]
    knots: Annotated[tuple[Knot, ...], Len(2, 200)]


if TYPE_CHECKING:
    PathShape = Line | Cosine | Circle | FigureEight | Spline | Choice
    Offset = World | Structure | Varying | Choice
else:
    _PATHS = Line | Cosine | Circle | FigureEight | Spline
    _OFFSETS = World | Structure | Varying

    def _names(shapes):
        """Values of the key `kind` that lead to a union of shapes."""
        kinds = (kind for shape in get_args(shapes) for kind in fields(shape))
        return frozenset(get_args(kind.type)[0] for kind in kinds if kind.name == "kind")

    PathShape = Annotated[
        _PATHS,
        Tagged("kind"),
        AlsoOwn(Chooser(Kind.PATH, "kind", {}), Kind.OFFSET, _names(_OFFSETS)),
    ]
    Offset = Annotated[
        _OFFSETS,
        Tagged("kind"),
        AlsoOwn(Chooser(Kind.OFFSET, "kind", {}), Kind.PATH, _names(_PATHS)),
    ]

AT_CENTRE = World(kind="world")
"""The offset of a robot that has none."""
