"""Colours against the formulas of WCAG 2.1 and of Machado, Oliveira and Fernandes (2009)."""

from itertools import combinations

import numpy as np
import pytest

from fleetloop.results.palette import DARK, LIGHT, MARKS, ROBOTS, Theme, robot_style, theme_css

DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
WHITE_POINT = (0.95047, 1.0, 1.08883)


def linear(colour: str) -> np.ndarray:
    c = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def contrast(one: str, other: str) -> float:
    darker, lighter = sorted(float(TO_XYZ[1] @ linear(colour)) for colour in (one, other))
    return (lighter + 0.05) / (darker + 0.05)


def lab(colour: str, deficiency: str) -> np.ndarray:
    seen = np.clip(np.array(DEFICIENCIES[deficiency]) @ linear(colour), 0.0, 1.0)
    part = TO_XYZ @ seen / WHITE_POINT
    x, y, z = np.where(part > 0.008856, np.cbrt(part), 7.787 * part + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("four", [ROBOTS[:4], ROBOTS[4:]])
def test_robots_of_one_dash_pattern_stay_apart_for_every_eye(
    deficiency: str, four: tuple[str, ...]
) -> None:
    seen = [lab(colour, deficiency) for colour in four]
    assert min(np.linalg.norm(one - other) for one, other in combinations(seen, 2)) > 15


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_lines_and_text_are_seen_on_both_grounds(theme: Theme) -> None:
    assert min(contrast(colour, theme.ground) for colour in ROBOTS) >= 3.0
    texts = (theme.text, theme.muted, theme.held, theme.failed, theme.open, theme.accent)
    for ground in (theme.ground, theme.raised):
        assert min(contrast(text, ground) for text in texts) >= 4.5


def test_thirty_two_robots_differ_in_colour_or_dash_or_marker() -> None:
    styles = [robot_style(n) for n in range(32)]
    assert len(set(styles)) == 32
    assert [style.dash for style in styles[:4]] == [()] * 4


def test_states_have_marks_of_their_own() -> None:
    assert len(set(MARKS.values())) == len(MARKS)
    assert set(MARKS) <= set(Theme._fields)


def test_the_dark_theme_is_the_systems_wish_unless_the_page_was_told_and_never_on_paper() -> None:
    light, *rest = theme_css().split("@media ")
    assert LIGHT.ground in light
    assert [part.partition(" {")[0] for part in rest] == [
        "screen",
        "screen and (prefers-color-scheme: dark)",
    ]
    assert all(DARK.ground in part for part in rest)
