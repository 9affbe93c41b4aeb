"""What a 3-D view draws, as templates of foxglove_msgs/SceneUpdate and FrameTransforms.

    robot     a box on two wheels (the origin is the middle of its axle), an arrow ahead, its name
    reference an arrow and a ball where the controller wants the robot
    edge      a line from the robot that is heard to the one that hears, an arrow head on it;
              heard: solid, from blue for news to orange for the oldest that still counts;
              not heard: grey strokes; the edge doesn't exist: nothing
    path      a line

All in the frame `world`, at the time of the message, for two periods of the view: what gets no
message any more vanishes. Each `..._template` lays variable numbers in the order in which the
function beside it gives them.
"""

from collections.abc import Callable, Mapping, Sequence
from math import sqrt

import numpy as np

from configs.brief import Wheels
from fleetloop.record.cdr import Layer, Template

WORLD = "world"
LIFETIME_PERIODS = 2
_KINDS = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
"""Primitives of an entity, in the order of the schema."""
_STRIP, _PAIRS = 0, 2
"""Types of lines: each point to the next; every two points."""
_STROKES = 8
"""Of an edge."""
_NEWS, _OLD, _SILENT = (0.0, 0.447, 0.698), (0.902, 0.624, 0.0), (0.55, 0.55, 0.55)
"""Colours of edges: #0072b2 and #e69f00 of Okabe and Ito, and grey."""
_SIDE_M = 0.04
"""Edges to and fro are so far right of the line between both robots."""
_HEAD_AT = 0.65
"""Of an edge, where its arrow head begins."""
_HALF = sqrt(0.5)
Colour = tuple[float, float, float]
_Lay = Callable[[], None]


def colour_of(text: str) -> Colour:
    """Red, green and blue, 0 to 1, of "#rrggbb"."""
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red / 255, green / 255, blue / 255


# --- robots, references, frames -------------------------------------------------------------------


def robots_template(robots: Sequence[tuple[str, Colour, Wheels]], lifetime_ns: int) -> Template:
    """An entity for each robot."""
    layer = _update(len(robots))
    for name, colour, wheels in robots:
        r, b = wheels.radius_m, wheels.half_track_m
        body, wheel = (2.0 * b, 1.6 * b, r), (2.0 * r, 2.0 * r, 0.3 * b)

        def arrow(b: float = b, r: float = r, colour: Colour = colour) -> None:
            _turned(layer, 2.0 * r)
            layer.float64(1.4 * b, 0.2 * b, 0.6 * b, 0.5 * b, *colour, 1.0)

        def cube(r: float = r, body: Colour = body, colour: Colour = colour) -> None:
            _turned(layer, 1.2 * r)
            layer.float64(*body, *colour, 0.85)

        def cylinder(r: float = r, wheel: Colour = wheel) -> None:
            layer.variable(2)
            layer.float64(r)
            layer.variable(4)
            layer.float64(*wheel, 1.0, 1.0, 0.25, 0.25, 0.25, 1.0)

        def text(r: float = r, name: str = name) -> None:
            _placed(layer, 6.0 * r)
            layer.uint8(1)  # faces the camera
            layer.float64(14.0)
            layer.uint8(1)  # pixels
            layer.float64(0.5, 0.5, 0.5, 1.0)
            layer.string(name)

        _entity(
            layer,
            f"robot {name}",
            lifetime_ns,
            {"arrows": [arrow], "cubes": [cube], "cylinders": [cylinder] * 2, "texts": [text]},
        )
    return layer.template()


def robots_numbers(poses: np.ndarray, half_track_m: np.ndarray) -> np.ndarray:
    """Of poses x, y [m], θ [rad] by robot and time: a row for each time."""
    x, y, half = poses[..., 0], poses[..., 1], poses[..., 2] / 2
    sin, cos = np.sin(half), np.cos(half)
    turned = (x, y, sin, cos)
    # Of a cylinder the axis is z: turned about x by a quarter, then with the robot.
    axle = (_HALF * cos, _HALF * sin, _HALF * sin, _HALF * cos)
    left = half_track_m[:, None]
    dx, dy = -left * np.sin(poses[..., 2]), left * np.cos(poses[..., 2])
    wheels = (x - dx, y - dy, *axle, x + dx, y + dy, *axle)
    return _by_time((*turned, *turned, *wheels, x, y))


def references_template(robots: Sequence[tuple[str, Colour]], lifetime_ns: int) -> Template:
    """An entity for each robot that has a reference."""
    layer = _update(len(robots))
    for name, colour in robots:

        def arrow(colour: Colour = colour) -> None:
            _turned(layer, 0.02)
            layer.float64(0.16, 0.02, 0.07, 0.06, *colour, 0.6)

        def sphere(colour: Colour = colour) -> None:
            _placed(layer, 0.02)
            layer.float64(0.06, 0.06, 0.06, *colour, 0.6)

        _entity(layer, f"reference {name}", lifetime_ns, {"arrows": [arrow], "spheres": [sphere]})
    return layer.template()


def references_numbers(poses: np.ndarray) -> np.ndarray:
    """Of reference poses x, y [m], θ [rad] by robot and time: a row for each time."""
    x, y, half = poses[..., 0], poses[..., 1], poses[..., 2] / 2
    return _by_time((x, y, np.sin(half), np.cos(half), x, y))


def transforms_template(robots: Sequence[str]) -> Template:
    """foxglove_msgs/FrameTransforms: from `world` to the frame of each robot, named as it is."""
    layer = Layer()
    layer.uint32(len(robots))
    for name in robots:
        layer.stamp()
        layer.string(WORLD)
        layer.string(name)
        _turned(layer, 0.0)
    return layer.template()


def transforms_numbers(poses: np.ndarray) -> np.ndarray:
    """Of poses x, y [m], θ [rad] by robot and time: a row for each time."""
    half = poses[..., 2] / 2
    return _by_time((poses[..., 0], poses[..., 1], np.sin(half), np.cos(half)))


# --- paths and edges ------------------------------------------------------------------------------


def paths_template(paths: Sequence[tuple[str, Colour, np.ndarray]]) -> Template:
    """An entity for each path, of its points (n, 2), for good; no variable numbers."""
    layer = _update(len(paths))
    for name, colour, points in paths:

        def line(points: np.ndarray = points, colour: Colour = colour) -> None:
            _line(layer, _STRIP, len(points))
            layer.float64(*np.pad(points, ((0, 0), (0, 1))).ravel())
            layer.float64(*colour, 0.5)
            _no_colours_or_indices(layer)

        _entity(layer, f"path {name}", 0, {"lines": [line]})
    return layer.template()


def edges_template(edges: Sequence[tuple[str, str]], lifetime_ns: int) -> Template:
    """An entity for each edge (speaker, hearer)."""
    layer = _update(len(edges))

    def head() -> None:
        _turned(layer, 0.05)
        layer.float64(0.02, 0.02, 0.14, 0.1)
        layer.variable(4)

    def line() -> None:
        _line(layer, _PAIRS, 2 * _STROKES)
        for _ in range(2 * _STROKES):
            layer.variable(2)
            layer.float64(0.05)
        layer.variable(4)
        _no_colours_or_indices(layer)

    for speaker, hearer in edges:
        primitives = {"arrows": [head], "lines": [line]}
        _entity(layer, f"edge {speaker} -> {hearer}", lifetime_ns, primitives)
    return layer.template()


def edges_numbers(
    begins: np.ndarray, ends: np.ndarray, exists: np.ndarray, age: np.ndarray
) -> np.ndarray:
    """Of all edges by edge and time: a row for each time.

    Args:
        begins: places x, y [m] of the robot that is heard.
        ends: places x, y [m] of the robot that hears.
        exists: whether the edge does.
        age: of what is heard as a share of the oldest that counts, NaN: nothing is heard.
    """
    along = ends - begins
    length = np.hypot(along[..., 0], along[..., 1])
    heading = np.arctan2(along[..., 1], along[..., 0])
    side = np.stack([np.sin(heading), -np.cos(heading)], axis=-1)
    begins = begins + _SIDE_M * np.where(length > 0.0, 1.0, 0.0)[..., None] * side
    heard = np.isfinite(age)
    stroke = np.where(exists, np.where(heard, 1.0, 0.5), 0.0) / _STROKES
    begin = np.where(exists[..., None], np.arange(_STROKES) / _STROKES, 0.0)
    shares = np.stack([begin, begin + stroke[..., None]], axis=-1)
    shares = shares.reshape(*begin.shape[:-1], 2 * _STROKES)
    points = begins[..., None, :] + shares[..., None] * along[..., None, :]
    head = begins + _HEAD_AT * along
    colour = _edge_colours(exists, np.where(heard, age, 0.0), heard)
    turned = np.stack([np.sin(heading / 2), np.cos(heading / 2)], axis=-1)
    flat = points.reshape(*points.shape[:-2], 4 * _STROKES)
    return _rows(np.concatenate([head, turned, colour, flat, colour], axis=-1))


def _edge_colours(exists: np.ndarray, age: np.ndarray, heard: np.ndarray) -> np.ndarray:
    """Red, green, blue and opacity."""
    # By the root of the age: what is new and what is a bit older stay apart.
    share = np.sqrt(np.clip(age, 0.0, 1.0))[..., None]
    shade = (1.0 - share) * np.array(_NEWS) + share * np.array(_OLD)
    shade = np.where(heard[..., None], shade, np.array(_SILENT))
    return np.concatenate([shade, np.where(exists, 0.9, 0.0)[..., None]], axis=-1)


# --- parts ----------------------------------------------------------------------------------------


def _update(entities: int) -> Layer:
    """A SceneUpdate up to its entities."""
    layer = Layer()
    layer.uint32(0)  # deletions
    layer.uint32(entities)
    return layer


def _entity(
    layer: Layer, name: str, lifetime_ns: int, primitives: Mapping[str, Sequence[_Lay]]
) -> None:
    layer.stamp()
    layer.string(WORLD)
    layer.string(name)
    layer.duration(lifetime_ns)
    layer.uint8(0)  # it stays where it is in `world`
    layer.uint32(0)  # metadata
    for kind in _KINDS:
        laid = primitives.get(kind, ())
        layer.uint32(len(laid))
        for lay in laid:
            lay()


def _turned(layer: Layer, z_m: float) -> None:
    """A pose in the plane: x and y, sine and cosine of half the heading are variable."""
    layer.variable(2)
    layer.float64(z_m, 0.0, 0.0)
    layer.variable(2)


def _placed(layer: Layer, z_m: float) -> None:
    """A pose that isn't turned: x and y are variable."""
    layer.variable(2)
    layer.float64(z_m, 0.0, 0.0, 0.0, 1.0)


def _line(layer: Layer, kind: int, points: int) -> None:
    """A LinePrimitive up to its points."""
    layer.uint8(kind)
    layer.float64(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    layer.float64(2.0)
    layer.uint8(1)  # the thickness is in pixels
    layer.uint32(points)


def _no_colours_or_indices(layer: Layer) -> None:
    layer.uint32(0)
    layer.uint32(0)


def _by_time(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Columns by entity and time as rows by time."""
    return _rows(np.stack(columns, axis=-1))


def _rows(numbers: np.ndarray) -> np.ndarray:
    """Numbers by entity, time and column as rows by time."""
    return numbers.swapaxes(0, 1).reshape(numbers.shape[1], -1)
