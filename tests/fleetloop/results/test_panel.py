"""Axes of panels: what is on them, what is beyond; bands of many signals."""

import numpy as np
import pytest

from fleetloop.results.decimation import Points
from fleetloop.results.panel import FLOORS, Line, LineStyle, Panel, logarithmic_span, span
from fleetloop.results.view import banded

T = np.arange(1001.0)


def line(values: np.ndarray) -> Line:
    return Line("r1", (), LineStyle("#000000"), Points(T, values))


def test_an_axis_has_all_values_and_a_little_more() -> None:
    low, high = span([np.linspace(-1.0, 3.0, 1001)], "m")
    assert (low, high) == pytest.approx((-1.0 - 0.06 * 4.0, 3.0 + 0.06 * 4.0))


def test_noise_is_not_drawn_at_full_height() -> None:
    low, high = span([1e-9 * np.sin(T)], "m")
    assert high - low == pytest.approx(1.12 * FLOORS["m"])
    assert low == pytest.approx(-high, abs=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rare_spike_is_beyond_the_axis_and_named(sign: float) -> None:
    values = sign * np.sin(T)
    values[3] = 500.0 * sign
    panel = Panel("torque", "N·m", lines=[line(values)])
    assert max(map(abs, panel.span)) < 4.0
    assert panel.beyond == f"beyond the axis: {500 * sign:g} N·m at 3 s (r1)"
    often = np.where(T < 100, 500.0 * sign, values)
    panel = Panel("torque", "N·m", lines=[line(often)])
    assert max(map(abs, panel.span)) > 500.0
    assert panel.beyond == ""


def test_a_bound_is_on_the_axis_unless_it_is_far_away() -> None:
    values = [np.linspace(0.0, 1.0, 101)]
    assert span(values, "m", [5.0]).high > 5.0
    assert span(values, "m", [50.0]) == span(values, "m")


@pytest.mark.parametrize("values", [np.empty(0), np.full(5, np.nan), np.full(5, 1e31)])
def test_nothing_that_can_be_drawn_gives_an_axis_all_the_same(values: np.ndarray) -> None:
    assert span([values], "m") == (-0.5 * FLOORS["m"], 0.5 * FLOORS["m"])
    assert logarithmic_span([values], "m") == (1e-3, 1.0)


def test_a_logarithmic_axis_has_whole_decades_and_no_value_below_zero() -> None:
    assert logarithmic_span([np.array([0.02, 3.0, -1e6, 0.0, np.nan])], "m") == (0.01, 10.0)
    assert logarithmic_span([np.full(5, 1.0)], "m") == (1.0, 10.0)


def test_a_logarithmic_axis_reaches_the_least_span_of_its_unit() -> None:
    noise = np.geomspace(2e-8, 9e-8, 100)
    low, high = logarithmic_span([noise], "m")
    assert low == pytest.approx(1e-8)
    assert FLOORS["m"] <= high == pytest.approx(1e-2)


def test_a_band_has_the_extremes_of_all_series_in_each_stretch() -> None:
    wave, short = np.sin(T), np.full(500, 2.0)
    short[:100] = np.nan
    t, low, high = banded([wave, short], T, 10)
    step = 101
    assert t.tolist() == T[::step].tolist()
    for n, begin in enumerate(range(0, len(T), step)):
        part, other = wave[begin : begin + step], short[begin : begin + step]
        known = np.concatenate([part, other[np.isfinite(other)]])
        assert (low[n], high[n]) == (known.min(), known.max())
