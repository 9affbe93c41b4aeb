"""Colours of pages and figures: robots, states, and the two themes of a page.

A robot has one colour on both grounds (3:1 to either, WCAG 1.4.11). The colours come in fours:
those of one dash pattern stay apart with any of the three colour-vision deficiencies. The first
four are of Okabe and Ito, "Color Universal Design" (2008). A state is a colour and a mark, never a
colour alone.
"""

from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from bokeh.themes import Theme as PlotTheme

ROBOTS: Final = (
    "#0072b2",  # blue
    "#d55e00",  # vermillion
    "#009e73",  # bluish green
    "#cc79a7",  # reddish purple
    "#ad8300",  # ochre
    "#3c9dd0",  # sky blue
    "#7d7d7d",  # grey
    "#b0459c",  # magenta
)
_FOUR = 4
_DASHES: Final = ((), (7, 3), (2, 2), (9, 2, 2, 2))
_MARKERS: Final = ("circle", "square", "triangle", "diamond", "inverted_triangle", "hex", "star")


class RobotStyle(NamedTuple):
    """Of a robot's lines and marks."""

    colour: str
    dash: tuple[int, ...]
    """Lengths of strokes and gaps [px], none: solid."""
    marker: str
    """A marker of Bokeh's."""


def robot_style(n: int) -> RobotStyle:
    """That of the n-th robot of a scenario, from 0."""
    return RobotStyle(
        ROBOTS[n % len(ROBOTS)],
        _DASHES[n // _FOUR % len(_DASHES)],
        _MARKERS[n // _FOUR % len(_MARKERS)],
    )


class Theme(NamedTuple):
    """Of a page; the names are those of its CSS variables."""

    ground: str
    raised: str
    """Behind tables, cards, buttons."""
    text: str
    muted: str
    """Text of lesser weight; 4.5:1 on both grounds, as all text."""
    rule: str
    """Lines between rows and around boxes."""
    grid: str
    held: str
    failed: str
    open: str
    """Not reached, not checked, interrupted, waited for."""
    accent: str
    """Links, focus, what is selected."""


LIGHT: Final = Theme(
    ground="#ffffff",
    raised="#f3f4f6",
    text="#1a1c20",
    muted="#555b66",
    rule="#d4d7dd",
    grid="#e6e8ec",
    held="#00664b",
    failed="#a63c00",
    open="#7a5c00",
    accent="#00588a",
)
DARK: Final = Theme(
    ground="#16181c",
    raised="#22252b",
    text="#e8eaed",
    muted="#a4abb6",
    rule="#3b4048",
    grid="#2b2f36",
    held="#4fd1a5",
    failed="#ff9466",
    open="#e6c04c",
    accent="#7cc4f2",
)
MARKS: Final = {"held": "✓", "failed": "✕", "open": "○"}
"""Of a state, beside its colour."""
STATE_LINES: Final = {"held": ROBOTS[2], "failed": ROBOTS[1], "open": ROBOTS[4], "limit": "#7d7d7d"}
"""Of lines in plots, on both grounds: of a state, and of what a limit allows."""
ROBOT_OUTLINE: Final = ((1.0, 0.0), (-0.8, 0.65), (-0.45, 0.0), (-0.8, -0.65))
"""Corners of a robot as it is drawn in the plane, in body: x forward, y left."""

_PLOT: Final = {
    "background-fill-color": "ground",
    "border-fill-color": "ground",
    "outline-line-color": "rule",
    "text-color": "text",
    "grid-line-color": "grid",
    "axis-line-color": "muted",
    "axis-label-text-color": "text",
    "major-label-text-color": "muted",
    "major-tick-line-color": "muted",
    "minor-tick-line-color": "rule",
    "label-text-color": "text",
}
"""Bokeh's visuals that a page's theme decides, as `--bk-...`."""


def theme_css() -> str:
    """The variables of both themes: the system's preference, or `data-theme` of the root element.

    A Bokeh plot takes what it hasn't set itself from `--bk-...`, through shadow roots too, whenever
    it paints.
    """
    light, dark = _variables(LIGHT), _variables(DARK)
    return "\n".join(
        (
            f":root {{ color-scheme: light; {light}{_plot_variables()} }}",
            "@media screen {",
            f'  :root[data-theme="dark"] {{ color-scheme: dark; {dark} }}',
            "}",
            "@media screen and (prefers-color-scheme: dark) {",
            f'  :root:not([data-theme="light"]) {{ color-scheme: dark; {dark} }}',
            "}",
        )
    )


def _variables(theme: Theme) -> str:
    return " ".join(f"--{name}: {colour};" for name, colour in theme._asdict().items())


def _plot_variables() -> str:
    return "".join(f" --bk-{visual}: var(--{name});" for visual, name in _PLOT.items())


def plot_theme() -> "PlotTheme":
    """What plots of all pages have in common beside colours; for `Document.theme`."""
    from bokeh.themes import Theme as PlotTheme

    text = "12px"
    return PlotTheme(
        json={
            "attrs": {
                "Axis": {
                    "axis_label_text_font_style": "normal",
                    "axis_label_text_font_size": text,
                    "major_label_text_font_size": "11px",
                    "minor_tick_line_color": None,
                },
                "BasicTickFormatter": {"power_limit_low": -5, "power_limit_high": 6},
                "Title": {"text_font_size": "13px", "text_font_style": "bold"},
                "Legend": {
                    "label_text_font_size": text,
                    "background_fill_alpha": 0.0,
                    "border_line_color": None,
                },
                "Toolbar": {"logo": None, "autohide": True},
            }
        }
    )
