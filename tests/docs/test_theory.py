"""Numbers of closed form on the pages of theory and errata are those of their formulas."""

from math import atan, atan2, inf, pi, sin, sqrt

import numpy as np
import pytest
from support.snippets import HOME

from configs.sections import Body

THEORY, ERRATA = (
    " ".join((HOME / "docs" / name).read_text("utf-8").split())
    for name in ("theory.md", "errata.md")
)
P, Q, K4, H = 2.0, 1.0, 3.0, 0.001


def spectrum(hears: dict[int, list[int]]) -> list[complex]:
    """Eigenvalues other than 0 of L, by whom each robot hears."""
    adjacency = np.zeros((len(hears), len(hears)))
    for robot, others in hears.items():
        adjacency[robot, others] = 1.0
    values = np.linalg.eigvals(np.diag(adjacency.sum(axis=1)) - adjacency)
    return [complex(value) for value in values if abs(value) > 1e-9]


def ring(robots: int, heard: int = 1) -> list[complex]:
    """Each hears those before it on a circle."""
    return spectrum({n: [(n - 1 - k) % robots for k in range(heard)] for n in range(robots)})


def largest_delay_s(values: list[complex]) -> float:
    """T* of the page."""
    least = inf
    for zeta in values:
        w = sqrt((sqrt(P**4 + 4.0 * Q**2 * abs(zeta) ** 2) - P**2) / 2.0)
        least = min(least, (atan(P / w) - abs(atan2(zeta.imag, zeta.real))) / w)
    return least


def inertias() -> tuple[float, float]:
    """m̄_1 and m̄_2 of the paper's robot [kg·m²]."""
    b = Body()
    m = b.body_mass_kg + b.wheel_mass_kg
    i = b.body_mass_kg * b.com_offset_m**2 + 2.0 * b.wheel_mass_kg * b.half_track_m**2
    i += b.body_inertia_kg_m2 + 2.0 * b.wheel_diameter_inertia_kg_m2
    scale = (b.wheel_radius_m / (2.0 * b.half_track_m)) ** 2
    m11 = scale * (m * b.half_track_m**2 + i) + b.wheel_axle_inertia_kg_m2
    m12 = scale * (m * b.half_track_m**2 - i)
    return m11 + m12, m11 - m12


CHAIN = [1.0 + 0.0j]
COMPLETE = [101.0 + 0.0j]
TIMES = [largest_delay_s(CHAIN), largest_delay_s(ring(4)), largest_delay_s(COMPLETE)]
LIMITS = [2.0 * sin(pi / (2 * (2 * d + 1))) for d in range(5)]
NEEDED = max(zeta.imag**2 / zeta.real for zeta in ring(20, heard=3))


@pytest.mark.parametrize(
    "said",
    [
        "of {:.2f} s for a chain, {:.2f} s for a ring of four, {:.2f} s".format(*TIMES),
        "which is {:.0f}, {:.0f}, {:.2f}, {:.2f}, {:.2f} for".format(*LIMITS),
        f"needs $p^2/q > {NEEDED:.2f}$",
        "({:.2f}, {:.2f})".format(*(1e3 * it for it in inertias())),
        f"{1e3 * pi / 2 * min(inertias()) / K4:.1f} ms",
        f"at 1 kHz and 1024 counts {K4 * 2.0 * pi / (1024 * H):.0f} N·m",
    ],
)
def test_a_number_of_the_theory_is_that_of_its_formula(said: str) -> None:
    assert said in THEORY


def test_the_papers_gains_violate_its_sufficient_condition() -> None:
    gamma_1, k3 = 0.01, 1.5
    least = (3.0 * gamma_1 + 1.0) / (2.0 * gamma_1)
    assert f"{k3} − {least:.1f} = −{least - k3:.0f}" in ERRATA
